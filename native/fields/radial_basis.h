// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "core/types.h"
#include "fields/interior_embedding.h"

namespace arapfields {

/// Centers of one size, spread evenly over the surface.
struct RadialScale {
  Index count = 300;           ///< centers
  double radius_factor = 4.0;  ///< radius over the fill distance
  bool two_layers = false;     ///< every other center is below its neighbour, inside the shape
};

/// The distribution of centers over points (n,3) of a surface.
struct RadialLayout {
  Vector sizes = {};  ///< (n, positive; empty: all 1) relative spacing and radius of centers at each point
  Points inner = {};  ///< (n,3; empty: scales have one layer) the point inside the shape below each
  /// (n,3; empty: none) ψ at each point, which joins the distances between centers as it does those in a
  /// basis
  Points embedded = {};
};

/// The space of maps f(x) = Σ_m c_m φ(|x − p_m|² / r_m²) + (1, x)·c_affine, φ(s) = (1 − s/κ)₊^κ: the Gaussian
/// e^{−s} for large κ, κ = 6 (fields/radial_kernel.h), but with a bounded support, so that a
/// point feels nearby centers alone, and κ − 1 times continuously differentiable. Coefficients are (size, 3):
/// centers, then the constant, then x, y, z. With an embedding ψ, s = (|x − p_m|² + |ψ(x) − ψ(p_m)|²) / r_m².
struct ARAPFIELDS_EXPORT RadialBasis {
  Points centers;  ///< (m,3)
  Vector radii;    ///< (m)
  std::shared_ptr<const InteriorEmbedding> embedding = nullptr;
  Points embedded = {};  ///< (m,3) ψ(p_m); empty without an embedding

  Index center_count() const { return centers.rows(); }
  Index size() const { return centers.rows() + 4; }
  /// Coefficients of f(x) = x.
  RowMatrix<double> identity() const;
  /// Takes an embedding, or none.
  void set_embedding(std::shared_ptr<const InteriorEmbedding> other);
};

/// Centers at farthest-point samples of the points, scale by scale, each with at most as many centers as
/// there are distinct points. Functions centered on the surface have no derivative across it: a second layer
/// allows different motions of skin and core. Throws InvalidInput for no points or scales without centers or
/// radius_factor.
ARAPFIELDS_EXPORT RadialBasis radial_basis(PointsIn points, const std::vector<RadialScale>& scales,
                                           const RadialLayout& layout = {});

/// Indices of `count` farthest-point samples, and the fill distance: the largest of a point to its nearest
/// sample. Distances are divided by the sizes (n; empty: all 1) of the samples that they are measured from;
/// `embedded` (n,3; empty: none): further coordinates of the points.
struct FarthestPoints {
  std::vector<Index> indices;
  double fill_distance = 0.0;
};
ARAPFIELDS_EXPORT FarthestPoints farthest_points(PointsIn points, Index count, const Vector& sizes = {},
                                                 const Points& embedded = {});

}  // namespace arapfields
