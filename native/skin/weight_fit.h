// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "skin/example_poses.h"

namespace arapfields {

/// Linear blend weights of a rig's nodes: ≥ 0, of sum one, that reproduce example poses in least squares and
/// vary smoothly through the shape.
class WeightFit {
 public:
  static constexpr Index most_candidates = 8;  ///< bones that a node's weights are sought among
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_candidates, most_candidates>;

  explicit WeightFit(const RigShape& rig);

  /// Takes a pose into account.
  void add(const ExamplePose& pose);
  /// Solves for the weights, with so many bones a node at most.
  void solve(int influences, double smoothness, const Progress& progress);
  /// (nodes, bones)
  const RowMatrix<float>& weights() const { return weights_; }
  /// Mean square distance (nodes) of the weights' shape from a pose's, and that of all poses added.
  Vector squared_errors(const ExamplePose& pose) const;
  double mean_squared_error() const;

 private:
  using Candidates = std::vector<Index>;
  void choose_candidates();
  void update(Index node, int influences, double smoothness);

  const RigShape& rig_;
  std::vector<Candidates> candidates_;
  /// wᵀ G w is the sum over the poses of the squared distance from the pose, for weights of sum one.
  std::vector<Square> squares_;
  Index poses_ = 0;
  RowMatrix<float> weights_;
};

}  // namespace arapfields
