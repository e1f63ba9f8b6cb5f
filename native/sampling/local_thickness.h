// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/types.h"

namespace arapfields {

struct FineRegion;

/// The local thickness of a shape at points of its surface, in units of the points: the radius of the largest
/// ball inside the shape that (nearly) contains the point, averaged over neighbours (half of Hildebrand and
/// Rüegsegger 1997, "A new method for the model-independent assessment of thickness"). It is clamped to
/// between 0.02 and 0.6 of the radius of gyration. The upper limit also holds where no opposite side bounds a
/// ball, as where normals point inwards. Open sheets have at most the thickness of leather of their size:
/// 0.03 of the square root of their area.
class LocalThickness {
 public:
  /// From samples (n,3) of a surface and their outward unit normals (n,3); without normals it is the upper
  /// limit everywhere. `order` is a spatially coherent permutation of the samples, `sheet_sizes` (n; empty:
  /// all 0) the square root of the area of the open sheet that each lies on, 0 on no sheet. It is measured at
  /// no more than `most` of the samples.
  LocalThickness(PointsIn samples, PointsIn normals, const std::vector<std::uint32_t>& order,
                 const Vector& sheet_sizes = {}, Index most = 1500);

  /// Measures the thickness in a fine region anew, at its own points.
  void refine(const FineRegion& region);

  /// At points (m,3) of the surface.
  Vector at(PointsIn points) const;
  /// Places of the surface at which it was measured to be less than this.
  Points thinner_than(double thickness) const;
  /// The median over the surface.
  double median() const { return median_; }

 private:
  Vector blended(PointsIn points) const;

  Points nodes_;
  Vector values_;             // at nodes
  std::vector<bool> sheets_;  // whether nodes lie on open sheets
  struct Fine;
  std::vector<std::shared_ptr<const Fine>> fine_;
  double spacing_ = 0.0, most_ = 0.0, median_ = 0.0;
};

}  // namespace arapfields
