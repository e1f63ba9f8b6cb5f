// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/limb_sides.h"
#include "skin/rig_shape.h"
#include "skin/simplex_fit.h"

namespace arapfields {

/// The candidate bones of a point near a node, and their linear penalties in the fit of weights, which grow
/// with the interior distances (bones) of the node.
class BoneChoice {
 public:
  /// Bones on the opposite side of `side` (±1; 0: none) have a reduced influence, `share` in [0, 1].
  BoneChoice(const RigShape& rig, Index node,
             const Eigen::Ref<const Eigen::Matrix<float, 1, Eigen::Dynamic>>& distances, int side,
             double share);

  Index count() const { return static_cast<Index>(bones.size()); }
  /// The Gram matrix G (count, count) of the bones' errors: for weights of sum one, wᵀ G w is the squared
  /// distance, in sizes of the shape, of the skinned point from its position `there` in a pose.
  BonePairs square(const Vec3& rest, const std::vector<Mat4>& motions, const Vec3& there,
                   double extent) const;

  /// G with the block of the opposite side's bones divided by `share`, which reduces their weights.
  BonePairs held_back(const BonePairs& squares) const;

  std::vector<Index> bones;  ///< in ascending order of distance
  FewBones penalties;

 private:
  std::vector<Index> others_;  // positions in `bones` of those on the opposite side
  double share_;
};

}  // namespace arapfields
