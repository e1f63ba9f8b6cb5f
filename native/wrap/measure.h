// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "wrap/target.h"
#include "wrap/wrap.h"

namespace arapfields {

/// A surface under a deformation field.
struct MovedSurface {
  Points points;                ///< (n,3)
  Points normals;               ///< (n,3), of length 1
  RowMatrix<double> jacobians;  ///< (n,9), row-major
  Vector growth;                ///< (n) area ratios
  Distortion distortion;

  MovedSurface(const DeformationField& field, PointsIn surface, PointsIn surface_normals);
};

/// Fills a report's distances, distortion and energy for a field that maps a surface, points (n,3) with unit
/// normals, onto the target, both in cube coordinates.
void measure(const DeformationField& field, PointsIn surface, PointsIn surface_normals,
             const WrapTarget& target, WrapReport& report);

}  // namespace arapfields
