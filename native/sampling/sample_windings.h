// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Winding numbers of a surface by samples of it as dipoles, of which those in a cell of a grid are one
/// (Barill et al. 2018, Fast winding numbers for soups and clouds). Blurred within a cell of the surface.
class SampleWindings {
 public:
  /// For places (n,3), their normals times the area that each stands for, and the edge of a cell.
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
