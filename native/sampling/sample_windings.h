// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Winding numbers of a sampled surface, by one dipole for the samples in each cell of a grid (Barill et al.
/// 2018, Fast winding numbers for soups and clouds). Smoothed within a cell's distance of the surface.
class SampleWindings {
 public:
  /// For places (n,3), their normals (n,3) times area weights, and the edge of a cell.
  SampleWindings(PointsIn places, PointsIn normals, double edge);
  /// Positive inside, where the normals point outwards.
  double at(const Vec3& place) const;

 private:
  using Columns = Eigen::Array<float, Eigen::Dynamic, 3>;
  Columns places_;
  Columns normals_;  // times the area over 4 π
  float blur_;
};

}  // namespace arapfields
