// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/random.h"
#include "core/task.h"
#include "options/skin.h"
#include "skin/rig_shape.h"
#include "solve/radial/radial_solver.h"

namespace arapfields {

/// The correspondence of mirrored bones, and of mirrored points, under a rig's symmetry across a coordinate
/// plane; empty without one.
struct RigTwins {
  RigTwins(const RigShape& rig, PointsIn points);

  /// The mirrored point, −1: none.
  Index twin(Index point) const { return twins.empty() ? -1 : twins[point]; }
  /// The point nearest to the mirrored place, −1: none is near. It replaces a missing twin, so that points
  /// without one get weights like their neighbours.
  Index like(Index point) const { return alike.empty() ? -1 : alike[point]; }
  /// Averages values (points, bones) with those of the twins (or their replacements) and mirrored bones.
  void average_twins(RowMatrix<float>& values) const { average(values, twins); }
  void average_alike(RowMatrix<float>& values) const { average(values, alike); }

  std::vector<Index> bones;  ///< mirrored bone of each; empty without a symmetry
  std::vector<Index> twins;
  std::vector<Index> alike;

 private:
  void average(RowMatrix<float>& values, const std::vector<Index>& others) const;
};

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
