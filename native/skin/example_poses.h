// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/random.h"
#include "core/task.h"
#include "options/skin.h"
#include "skin/rig_shape.h"
#include "solve/radial/radial_solver.h"

namespace arapfields {

/// A rig's pose and the shape that the field gives it.
struct ExamplePose {
  std::vector<Mat3> rotations;  ///< of the deforming bones, in their own axes
  std::vector<Mat4> motions;
  PointsF shape;  ///< (n,3)
};

/// Poses a shape by its bones as handles.
class ExamplePoses {
 public:
  /// The field moves these points (n,3).
  ExamplePoses(const RigShape& rig, PointsIn points, const SkinOptions& options, const Progress& progress);

  /// From now on what bones hold goes with them, of points near these nodes (n).
  void hold(const std::vector<Index>& near);

  /// A pose in which each joint turns with this probability (joints), within its limits.
  ExamplePose draw(Random& random, const Vector& activity, const Progress& progress);

 private:
  const RigShape& rig_;
  RadialSolver solver_;
  Points points_;
  std::vector<Index> holders_;
};

}  // namespace arapfields
