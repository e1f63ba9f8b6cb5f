// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "skin/bone_choice.h"
#include "skin/example_poses.h"
#include "skin/rig_twins.h"

namespace arapfields {

/// Weight of the smoothness at option 1, for squared distances in sizes of the shape.
constexpr double smoothness_weight = 3e-4;

/// Linear blend weights of a rig's nodes: ≥ 0, of sum one, that reproduce example poses in least squares and
/// vary smoothly through the shape.
class WeightFit {
 public:
  explicit WeightFit(const RigShape& rig);

  /// Takes a pose into account, whose first rows are the nodes'.
  void add(const ExamplePose& pose);
  /// Solves for the weights.
  void solve(double smoothness, const Progress& progress);
  /// (nodes, bones)
  const RowMatrix<float>& weights() const { return weights_; }
  /// How much each bone is wanted (nodes, bones) where so few may move a node: the mean over the nodes about
  /// it of the weights of the fit with so few, which alone would change from one node to the next.
  RowMatrix<float> support(double smoothness, int influences) const;
  /// Squared distances (nodes) of the weights' shape from a pose's, in sizes of the shape.
  Vector squared_errors(const ExamplePose& pose) const;

 private:
  FewBones minimum(Index node, double smoothness, int influences) const;

  const RigShape& rig_;
  std::vector<BoneChoice> choices_;
  std::vector<BonePairs> squares_;  // over all poses
  Index poses_ = 0;
  RowMatrix<float> weights_;
};

/// Points of a rig's shape beside its nodes, and what the nodes tell there.
struct SkinPoints {
  const Points& places;
  const std::vector<Index>& near;  ///< the nodes that they are nearest to
  RowMatrix<float> weights;        ///< (points, bones) as of WeightFit
  RowMatrix<float> support;        ///< (points, bones) as of WeightFit
  RowMatrix<float> distances;      ///< (points, bones) through the inside
  RigTwins twins;
};

/// Weights of points, at most `influences` a point above 0, that reproduce the same poses, whose rows after
/// the nodes' are the points'. What the poses leave open is as the nodes' weights there, and which bones it
/// may be is told by their support.
RowMatrix<float> point_weights(const RigShape& rig, const SkinPoints& points, const LimbSides& limbs,
                               const std::vector<ExamplePose>& poses, const SkinOptions& options);

}  // namespace arapfields
