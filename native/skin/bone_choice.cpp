// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_choice.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace arapfields {
namespace {

/// Candidate bones are nearer than this multiple of the nearest bone's interior distance.
constexpr float farthest_share = 12.0f;
/// Weight of the penalties, in squared sizes of the shape.
constexpr double distance_weight = 2e-6;

}  // namespace

BoneChoice::BoneChoice(const RigShape& rig, Index node,
                       const Eigen::Ref<const Eigen::Matrix<float, 1, Eigen::Dynamic>>& distances, int side,
                       double share)
    : share_(share) {
  const Skeleton& skeleton = rig.skeleton;
  const auto is_other = [&](Index b) { return rig.sides[b] * side < 0; };
  std::vector<Index> all;
  for (Index b = 0; b < skeleton.count(); ++b)
    if (share > 0.0 || !is_other(b)) all.push_back(b);
  const Index most = std::min<Index>(most_candidates, static_cast<Index>(all.size()));
  std::ranges::partial_sort(all, all.begin() + most, {}, [&](Index b) { return distances[b]; });
  const float least = std::max(distances[all.front()], static_cast<float>(rig.spacing));
  for (Index k = 0; k < most; ++k)
    if (distances[all[k]] < farthest_share * least && rig.may_move(all[k], node, static_cast<double>(least)))
      bones.push_back(all[k]);
  if (bones.empty()) bones.push_back(all.front());
  for (Index k = 0; k < count(); ++k)
    if (is_other(bones[k])) others_.push_back(k);
  std::vector<double> costs;
  for (const Index b : bones) {
    const double farther = static_cast<double>(distances[b] / least) - 1.0;
    costs.push_back(distance_weight * farther * farther);
  }
  penalties = Eigen::Map<const Vector>(costs.data(), static_cast<Index>(costs.size()));
}

BonePairs BoneChoice::square(const Vec3& rest, const std::vector<Mat4>& motions, const Vec3& there,
                             double extent) const {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, most_candidates> off(3, count());
  for (Index k = 0; k < count(); ++k)
    off.col(k) = ((motions[bones[k]] * rest.homogeneous()).head<3>() - there) / extent;
  return off.transpose() * off;
}

BonePairs BoneChoice::held_back(const BonePairs& squares) const {
  BonePairs result = squares;
  for (const Index j : others_)
    for (const Index k : others_) result(j, k) /= share_;
  return result;
}

}  // namespace arapfields
