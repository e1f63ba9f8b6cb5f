// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/jets.h"
#include "fields/radial_kernel.h"

namespace arapfields {

/// Bumps of one size, spread evenly over the surface.
struct RadialScale {
  Index count = 300;   ///< bumps
  double reach = 4.0;  ///< radius as a multiple of the distance within which every sample has a bump
};

/// The space of maps f(x) = Σ_m c_m φ(|x − p_m|² / r_m²) + (1, x)·c_affine, φ(s) = (1 − s/κ)₊^κ: the Gaussian
/// e^{−s} for large κ, but with a bounded support, so that a point feels nearby bumps alone, and κ − 1 times
/// continuously differentiable. Coefficients are (size, 3): bumps, then the constant, then x, y, z.
struct RadialBasis {
  Points centers;  ///< (m,3)
  Vector radii;    ///< (m)

  Index bumps() const { return centers.rows(); }
  Index size() const { return centers.rows() + 4; }
  /// Coefficients of f(x) = x.
  RowMatrix<double> identity() const;
};

/// Bumps at farthest-point samples of the points, scale by scale (a scale with as many bumps as there are
/// distinct points or more is cut there). Throws InvalidInput for no points or scales without bumps or reach.
RadialBasis radial_basis(PointsIn points, const std::vector<RadialScale>& scales);

/// Rows of `points` in an order in which neighbours in the list are neighbours in space.
std::vector<Index> spatial_order(PointsIn points);

/// Indices of `count` farthest-point samples, and the largest distance of a point to them.
struct FarthestPoints {
  std::vector<Index> indices;
  double fill_distance = 0.0;
};
FarthestPoints farthest_points(PointsIn points, Index count);

/// Points at which fields of one basis are evaluated again and again. Cheap where consecutive points are
/// close (spatial_order): blocks of 16 keep lists of the bumps they feel.
class RadialSites {
 public:
  RadialSites() = default;
  RadialSites(const RadialBasis& basis, PointsIn points);
  Index size() const { return count_; }

  /// Jets of the field with these coefficients (size, 3): overwrites `out` (count = size(), any order).
  void evaluate(const RowMatrix<double>& coefficients, JetView<double> out) const;
  /// Adds to `gradient` (size, 3) what cotangents of such jets are worth.
  void pull_back(JetView<const double> cotangents, RowMatrix<double>& gradient) const;
  /// Basis functions' own jets at every `stride`-th point: (columns·⌈n/stride⌉, size), column by column.
  RowMatrix<double> rows(JetOrder order, Index stride = 1) const;

 private:
  Index blocks() const { return (count_ + 15) / 16; }

  Index bump_count_ = 0;
  Index count_ = 0;
  RadialBlock block(Index b) const;

  std::vector<double> points_;        // (blocks, 3, 16), the last point repeated
  std::vector<double> bumps_;         // (m, 4): center, 1/r²
  std::vector<std::int32_t> active_;  // bumps felt by block b: active_[start_[b]] … active_[start_[b+1]−1]
  std::vector<Index> start_;
};

}  // namespace arapfields
