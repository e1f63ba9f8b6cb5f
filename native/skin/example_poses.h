// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/random.h"
#include "core/task.h"
#include "options/skin.h"
#include "skin/rig_shape.h"
#include "solve/radial/radial_solver.h"

namespace arapfields {

/// A pose of a rig and the shape under the field.
struct ExamplePose {
  std::vector<Mat3> rotations;  ///< of the deforming bones, in their own axes
  std::vector<Mat4> motions;    ///< of the deforming bones, from rest
  PointsF shape;                ///< (n,3)
};

/// Generates example poses of a shape, with its bones as the field's handles.
class ExamplePoses {
 public:
  /// The field moves these points (n,3).
  ExamplePoses(const RigShape& rig, PointsIn points, const SkinOptions& options, const Progress& progress);

  /// From now on points that RigShape::holder() assigns to a bone move rigidly with it; `near` (n) are the
  /// points' nearest nodes.
  void hold(const std::vector<Index>& near);

  /// A random pose: each joint rotates within its limits, with the probability `activity` (joints).
  ExamplePose draw(Random& random, const Vector& activity, const Progress& progress);

 private:
  const RigShape& rig_;
  RadialSolver solver_;
  Points points_;
  std::vector<Index> holders_;
};

}  // namespace arapfields
