// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/limb_sides.h"
#include "skin/rig_shape.h"
#include "skin/simplex_fit.h"

namespace arapfields {

/// Which bones may move a point of the shape at rest that is near a node, and how much each is disfavoured
/// for being far, from the lengths (bones) of the ways to them through the inside.
class BoneChoice {
 public:
  /// Bones of the other side than this one count by this share.
  BoneChoice(const RigShape& rig, Index node,
             const Eigen::Ref<const Eigen::Matrix<float, 1, Eigen::Dynamic>>& distances, int side,
             double share);

  Index count() const { return static_cast<Index>(bones.size()); }
  /// wᵀ G w is the squared distance in sizes of the shape, for weights of sum one, of a point from where a
  /// pose has it.
  BonePairs square(const Vec3& rest, const std::vector<Mat4>& motions, const Vec3& there,
                   double extent) const;

  /// The squares as they are minimised: the effect of bones of the other side costs more the less they count.
  BonePairs held_back(const BonePairs& squares) const;

  std::vector<Index> bones;  ///< the nearest first
  FewBones penalties;

 private:
  std::vector<Index> others_;  // of the bones, those of the other side
  double share_;
};

}  // namespace arapfields
