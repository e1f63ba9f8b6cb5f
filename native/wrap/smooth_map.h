// SPDX-License-Identifier: GPL-3.0-or-later
// Smoothing splines of space that map one surface to another.
#pragma once

#include <vector>

#include "core/decompositions.h"
#include "core/task.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// f(x) = A x + b + Σ w_i |x − c_i|³.
class ARAPFIELDS_EXPORT_TO_TESTS SmoothMap {
 public:
  /// Throw Cancelled.
  Points at(PointsIn points, const Progress& progress = {}) const;
  std::vector<Mat3> jacobians(PointsIn points, const Progress& progress = {}) const;

 private:
  friend class SmoothingSpline;
  using Columns = Eigen::Array<double, Eigen::Dynamic, 3>;
  /// Calls visit(row, x, ways, distances) for each point: x in normalised units, and x − c_i with its norms.
  template <class Visit>
  void visit(PointsIn points, const Progress& progress, Visit&& visit) const;
  Points in_units(PointsIn points) const { return (points.rowwise() - center_) / size_; }

  Eigen::RowVector3d center_;
  double size_ = 1.0;
  Columns centers_;
  Columns weights_;
  Eigen::Matrix<double, 4, 3> affine_;  // of 1, x, y, z
};

/// The smoothing spline, which minimises Σ |f(c_i) − y_i|² / s_i + ∫ |∇³f|² over all of space. Source: Duchon
/// 1977, "Splines Minimizing Rotation-Invariant Semi-Norms in Sobolev Spaces"; Wahba 1990, "Spline Models for
/// Observational Data", section 2.4.
class ARAPFIELDS_EXPORT_TO_TESTS SmoothingSpline {
 public:
  /// Distinct centers c (n,3), at least one, and smoothing parameters s (n, positive), in units in which the
  /// diagonal of the centers' bounding box is 1. Throws Cancelled.
  SmoothingSpline(PointsIn centers, const Vector& smoothing, const Progress& progress = {});

  SmoothMap fit(PointsIn values) const;

 private:
  SmoothMap map_;  // without weights
  OrthogonalFactor turn_;
  Eigen::MatrixXd across_;
  RowMatrix<double> factor_;  // empty for four centers and fewer
};

/// A spline that maps a mesh's surface to the one with vertices `to` (n,3). Across the surface space is
/// scaled like the square root of its area. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS SmoothMap surface_map(const TriangleMesh& from, PointsIn to,
                                                 const Progress& progress = {});

/// Maps displacements δ of points x (n,3) by a smooth map, or displacements of their images back. Where the
/// map does not reproduce a point's image, as between lips that part, the given Jacobians are used instead.
class ARAPFIELDS_EXPORT_TO_TESTS DisplacementMap {
 public:
  /// Throws Cancelled.
  DisplacementMap(SmoothMap map, PointsIn points, PointsIn images, std::vector<Mat3> jacobians,
                  bool back = false, const Progress& progress = {});

  /// In the direction of the displacements.
  const std::vector<Mat3>& jacobians() const { return jacobians_; }
  /// Weight of the map (n), from 0 to 1, against the given Jacobians.
  const Vector& trust() const { return trust_; }
  /// f(x + δ) − f(x), with the part beyond J δ limited relative to it; `back`: the δ that is mapped to the
  /// given displacement, by fixed-point iteration. Throws Cancelled.
  Points operator()(PointsIn displacements, const Progress& progress = {}) const;

 private:
  Points beyond_linear(const std::vector<Index>& rows, PointsIn displacements,
                       const Progress& progress) const;

  SmoothMap map_;
  Points points_;
  Points at_points_;
  std::vector<Mat3> jacobians_;      // as jacobians() returns them
  std::vector<Mat3> map_jacobians_;  // the map's own
  Vector trust_;
  bool back_ = false;
};

}  // namespace arapfields
