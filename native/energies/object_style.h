// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// A map T from directions to directions, read off a closed surface: T(n) is the surface's normal where the
/// ray from its centroid along n leaves it for the last time. Normals vary smoothly over what is bent by less
/// than 30° from triangle to triangle, so that a sphere's T is the identity however coarse its mesh, and jump
/// at sharper edges; there T is smoothed over a small angle. Directions in which nothing is left are kept.
class ARAPFIELDS_EXPORT ObjectStyle {
 public:
  /// Throws InvalidInput for a broken mesh, one that does not close, and one that encloses next to nothing,
  /// as a flat one. A surface that is inside out is turned.
  ObjectStyle(PointsIn vertices, TrianglesIn triangles, const Progress& progress = {});

  /// T at directions (n,3) of any length, smoothed over `smoothing` radians, at most a right angle.
  Points normals(PointsIn directions, double smoothing = usual_smoothing) const;
  /// The same object after a turn about its centroid.
  ObjectStyle turned(const Mat3& turn) const;
  /// Of the solid, in the mesh's coordinates.
  Vec3 centroid() const;

  static constexpr double usual_smoothing = 0.045;

 private:
  struct Surface;
  Vec3 normal(const Vec3& direction) const;

  std::shared_ptr<const Surface> surface_;
  Mat3 turn_ = Mat3::Identity();
};

}  // namespace arapfields
