// SPDX-License-Identifier: GPL-3.0-or-later
// The smoothest map of space that takes one surface to another.
#pragma once

#include <Eigen/QR>
#include <vector>

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
  /// Calls visit(row, x, ways, distances) for each point: in units, and from the centers.
  template <class Visit>
  void visit(PointsIn points, const Progress& progress, Visit&& visit) const;
  Points in_units(PointsIn points) const { return (points.rowwise() - center_) / size_; }

  Eigen::RowVector3d center_;
  double size_ = 1.0;
  Columns centers_;
  Columns weights_;
  Eigen::Matrix<double, 4, 3> affine_;  // of 1, x, y, z
};

/// The map that minimises Σ |f(c_i) − y_i|² / s_i + |∇³f|², the last over all of space: what is noise in y,
/// it leaves out. Source: Duchon 1977, "Splines Minimizing Rotation-Invariant Semi-Norms in Sobolev Spaces";
/// Wahba 1990, "Spline Models for Observational Data", section 2.4.
class ARAPFIELDS_EXPORT_TO_TESTS SmoothingSpline {
 public:
  /// Distinct centers c (n,3), one at least, and s (n, positive), how little each weighs: in units in which
  /// the diagonal of the centers' bounding box is 1. Throws Cancelled.
  SmoothingSpline(PointsIn centers, const Vector& smoothing, const Progress& progress = {});

  SmoothMap fit(PointsIn values) const;

 private:
  SmoothMap map_;  // without weights
  Eigen::HouseholderQR<Eigen::Matrix<double, Eigen::Dynamic, 4>> turn_;
  RowMatrix<double> across_;
  RowMatrix<double> factor_;  // empty for four centers and fewer
};

/// Takes the surface of a mesh to where its vertices are at `to` (n,3). A surface's curves and its other side
/// tell how space grows across it. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS SmoothMap surface_map(const TriangleMesh& from, PointsIn to,
                                                 const Progress& progress = {});

/// How a smooth map carries displacements δ of points x (n,3), or back those of their images. Where it misses
/// a point's own image, as where lips part, the Jacobians that are given count instead.
class ARAPFIELDS_EXPORT_TO_TESTS DisplacementMap {
 public:
  /// Throws Cancelled.
  DisplacementMap(SmoothMap map, PointsIn points, PointsIn images, std::vector<Mat3> jacobians,
                  bool back = false, const Progress& progress = {});

  /// In the direction of the displacements.
  const std::vector<Mat3>& jacobians() const { return jacobians_; }
  /// From 0 to 1 (n): how much the map counts.
  const Vector& trust() const { return trust_; }
  /// J δ, and what f(x + δ) − f(x) has beyond that; of far displacements a part. Back: the δ of which that
  /// is. Throws Cancelled.
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
