// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"
#include "skin/rig_shape.h"

namespace arapfields {

constexpr Index most_candidates = 12;  ///< most candidate bones of a point
using FewBones = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most_candidates, 1>;
using BonePairs = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_candidates, most_candidates>;

/// argmin wᵀHw/2 − gᵀw over w ≥ 0 of sum one, with at most `influences` entries above 0 (chosen greedily).
FewBones simplex_minimum(const BonePairs& h, const FewBones& g, int influences);

/// How much bones on the opposite side of a symmetric rig may move points (n,3), so that one leg does not
/// move the other: fully where the limbs are joined, falling to zero along a limb beyond the place where it
/// separates from its twin, and not across a gap that the points face. If parts of the shape touch, a point's
/// side is that of its owner bone.
struct LimbSides {
  /// `near` (n) are the points' nearest nodes; interior distances (n, bones), in the points' units.
  LimbSides(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& near,
            const RowMatrix<float>& distances);

  std::vector<int> sides;      ///< (n) side of each point, −1 or 1; 0: all bones have full influence
  std::vector<double> shares;  ///< (n) influence of the opposite side's bones, 0 to 1
};

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
