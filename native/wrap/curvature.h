// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "sampling/oriented_points.h"

namespace arapfields {

/// Curvature of a surface at n points, times a radius: the mean of the principal curvatures, and half of
/// their difference. It identifies places that distances cannot, along which a surface slides on another.
struct SurfaceCurvature {
  double radius = 0.0;          ///< of the fits
  RowMatrix<double> values;     ///< (n,2)
  RowMatrix<double> gradients;  ///< (n,6): of each value, along the surface
};

/// The two values (n,2) at places with unit normals (n,3), by weighted fits of quadrics to those points of a
/// surface that lie within twice the radius and face the same side. Source: Cazals, Pouget 2005, "Estimating
/// Differential Quantities Using Polynomial Fitting of Osculating Jets", section 3. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS RowMatrix<double> curvature_values(PointsIn points, PointsIn normals,
                                                              PointsIn places, PointsIn place_normals,
                                                              double radius, const Progress& progress);

/// The values at the same kind of places with their gradients, by linear fits within the radius to the values
/// at the points.
ARAPFIELDS_EXPORT_TO_TESTS SurfaceCurvature curvature_at(PointsIn points, PointsIn normals, PointsIn places,
                                                         PointsIn place_normals, double radius,
                                                         const Progress& progress);

}  // namespace arapfields
