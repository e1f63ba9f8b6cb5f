// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "skin/bone_choice.h"
#include "skin/example_poses.h"
#include "skin/rig_shape.h"

namespace arapfields {

/// Interpolates values at a rig's nodes to other points by moving least squares of first order, from nodes of
/// the same surface and side.
class VertexBlend {
 public:
  /// For these points and their nearest nodes.
  VertexBlend(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& nearest);

  /// Values (nodes, k) at the points (n, k).
  RowMatrix<float> operator()(const RowMatrix<float>& values) const;

 private:
  struct Entry {
    Index node;
    float weight;
  };
  std::vector<std::vector<Entry>> entries_;
};

/// Weight of the smoothness at option 1, for squared distances in sizes of the shape.
constexpr double smoothness_weight = 3e-4;

/// Linear blend weights of a rig's nodes: ≥ 0, of sum one, that reproduce example poses in least squares and
/// vary smoothly through the shape.
class WeightFit {
 public:
  explicit WeightFit(const RigShape& rig);

  /// Adds a pose, whose first rows are the nodes'.
  void add(const ExamplePose& pose);
  /// Solves for the weights.
  void solve(double smoothness, const Progress& progress);
  /// (nodes, bones)
  const RowMatrix<float>& weights() const { return weights_; }
  /// Preference of each bone (nodes, bones) for selecting `influences` of them: the weights of a fit with so
  /// few, smoothed over neighbouring nodes, without which the selection would change from node to node.
  RowMatrix<float> support(double smoothness, int influences) const;
  /// Squared distances (nodes) of the skinned nodes from a pose's shape, in squared sizes of the shape.
  Vector squared_errors(const ExamplePose& pose) const;

 private:
  FewBones minimum(Index node, double smoothness, int influences) const;

  const RigShape& rig_;
  std::vector<BoneChoice> choices_;
  std::vector<BonePairs> squares_;  // sums of the Gram matrices over all poses
  Index poses_ = 0;
  RowMatrix<float> weights_;
};

/// Points of a rig's shape other than its nodes, with values interpolated from the nodes.
struct SkinPoints {
  const Points& places;
  const std::vector<Index>& near;  ///< the nearest node of each
  RowMatrix<float> weights;        ///< (points, bones) as of WeightFit
  RowMatrix<float> support;        ///< (points, bones) as of WeightFit
  RowMatrix<float> distances;      ///< (points, bones) interior distances
  RigTwins twins;
};

/// Weights of points, at most options.influences above 0 a point, fitted to the same poses, whose rows after
/// the nodes' are the points'. They are regularised towards the interpolated weights of the nodes; the bones
/// are selected by their support.
RowMatrix<float> point_weights(const RigShape& rig, const SkinPoints& points, const LimbSides& limbs,
                               const std::vector<ExamplePose>& poses, const SkinOptions& options);

}  // namespace arapfields
