// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "core/types.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A map T from directions to normals of a closed surface: T(n) is the normal where the ray from the centroid
/// along n leaves the surface for the last time. Normals vary smoothly across edges of less than 30°, so that
/// a sphere's T is the identity for any mesh, and jump at sharper edges, where T is smoothed over a small
/// angle. A direction whose ray leaves no surface maps to itself.
class ARAPFIELDS_EXPORT ObjectStyle {
 public:
  /// Throws InvalidInput for a broken mesh, an open one and a flat one. A surface that is inside out is
  /// flipped.
  ObjectStyle(PointsIn vertices, TrianglesIn triangles, const Progress& progress = {});

  /// T at directions (n,3) of any length, smoothed over `smoothing` radians, at most a right angle.
  Points normals(PointsIn directions, double smoothing = usual_smoothing) const;
  /// The same object rotated about its centroid.
  ObjectStyle turned(const Mat3& turn) const;
  /// The mesh that it was made of, and its rotation.
  const TriangleMesh& mesh() const;
  const Mat3& turn() const { return turn_; }
  /// The solid's centroid, in mesh coordinates.
  Vec3 centroid() const;

  static constexpr double usual_smoothing = 0.045;

 private:
  struct Surface;
  Vec3 normal(const Vec3& direction) const;

  std::shared_ptr<const Surface> surface_;
  Mat3 turn_ = Mat3::Identity();
};

}  // namespace arapfields
