// SPDX-License-Identifier: GPL-3.0-or-later
// Rigid frames on a body's surface, and points that move with blends of them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/types.h"
#include "fields/field.h"

namespace arapfields {

/// Points on a surface at which rigid frames follow a deformation: 512 farthest-point samples, of which the
/// first 192 and the first 64 are evenly spread as well. Each of these three levels divides the surface's
/// area among its points.
class SurfaceFrames {
 public:
  static constexpr std::array<Index, 3> levels = {512, 192, 64};

  SurfaceFrames() = default;
  /// From samples (n,3) of the surface.
  explicit SurfaceFrames(PointsIn samples);
  const Points& points() const { return points_; }
  /// Which samples they are.
  const std::vector<Index>& rows() const { return rows_; }
  /// Area weights of a level's points; they sum to 1.
  const Vector& areas(std::size_t level) const { return areas_[level]; }

 private:
  Points points_;
  std::vector<Index> rows_;
  std::array<Vector, levels.size()> areas_;
};

/// The quintic smoothstep: 0 up to `low`, 1 from `high`, twice continuously differentiable.
double smooth_between(double low, double high, double x);

/// Points off a surface, each with weights for the frames that it moves with. The weights discretise an
/// integral over the surface of (1/d² − 1/c²)^1.5, with d the distance to the point and c a multiple of the
/// nearest frame's distance. That is nearly Poisson's kernel: between two limbs, motions blend as evenly as a
/// harmonic function does. Nearby parts are summed over the finest level, distant ones over coarser levels.
class CarriedPoints {
 public:
  CarriedPoints() = default;
  /// Points (n,3) with their distances (n, positive) to the surface of this size.
  CarriedPoints(const SurfaceFrames& frames, PointsIn points, const Vector& distances, double size);
  Index size() const { return points_.rows(); }

  /// The moved points (n,3), from the frames' positions (m,3) and rotations (3, m, 3: column by column, as
  /// the first derivatives of jets). Of the two ways to blend rigid motions, blending positions cuts corners
  /// where a surface bends, and blending maps overshoots by as much; the result is their mean. `growth` (m;
  /// empty: all 1): factors of the distances from the frames.
  Points moved(const SurfaceFrames& frames, PointsIn positions, const double* rotations,
               const Vector& growth) const;
  /// Weighted means (n) of the frames' values (m).
  Vector means(const Vector& values) const;
  /// The same over nearby frames alone.
  Vector nearby_means(const SurfaceFrames& frames, const Vector& values) const;

 private:
  void compute_weights(const SurfaceFrames& frames);

  Points points_;
  Vector distances_;
  double size_ = 1.0;
  Points centers_;                     // (n,3) weighted means of the frames' points
  std::vector<std::int64_t> start_;    // entries of point i: start_[i] … start_[i+1]−1
  std::vector<std::uint16_t> frames_;  // of each entry
  std::vector<float> weights_;         // of each entry; a point's sum to 1
};

}  // namespace arapfields
