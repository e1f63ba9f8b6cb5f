// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"
#include "skin/simplex_fit.h"

namespace arapfields {

/// Which bones may move a point of the shape at rest that is near a node, and how much each is disfavoured
/// for being far, from the lengths (bones) of the ways to them through the inside.
class BoneChoice {
 public:
  BoneChoice(const RigShape& rig, Index node,
             const Eigen::Ref<const Eigen::Matrix<float, 1, Eigen::Dynamic>>& distances);

  Index count() const { return static_cast<Index>(bones.size()); }
  /// wᵀ G w is the squared distance in sizes of the shape, for weights of sum one, of a point from where a
  /// pose has it.
  BonePairs square(const Vec3& rest, const std::vector<Mat4>& motions, const Vec3& there,
                   double extent) const;

  std::vector<Index> bones;  ///< the nearest first
  FewBones penalties;
};

}  // namespace arapfields
