// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/example_poses.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "sampling/oriented_points.h"
#include "solve/radial/rest_shape.h"

namespace arapfields {
namespace {

/// Tolerance of mirrored points, in sizes of the shape.
constexpr double symmetric_points = 1e-4;

}  // namespace

RigTwins::RigTwins(const RigShape& rig, PointsIn points) {
  if (!rig.symmetry.is_whole()) return;
  bones = rig.symmetry.mirrored;
  Points reflected = points;
  reflected.col(rig.symmetry.axis) =
      (2.0 * rig.symmetry.offset - points.col(rig.symmetry.axis).array()).matrix();
  const Points none = Points::Zero(points.rows(), 3);
  twins = OrientedPoints(points, none).nearest(reflected, none, 0.0);
  alike = twins;
  for (Index i = 0; i < points.rows(); ++i) {
    const double distance = (points.row(twins[i]) - reflected.row(i)).norm();
    if (distance > symmetric_points * rig.extent) twins[i] = -1;
    if (distance > rig.spacing) alike[i] = -1;
  }
}

void RigTwins::average(RowMatrix<float>& values, const std::vector<Index>& others) const {
  if (bones.empty()) return;
  const RowMatrix<float> before = values;
  for (Index i = 0; i < values.rows(); ++i)
    if (const Index other = others[i]; other >= 0)
      for (Index b = 0; b < values.cols(); ++b)
        values(i, b) = 0.5f * (before(i, b) + before(other, bones[b]));
}

namespace {

/// Largest angle of a joint without limits.
constexpr double largest_angle = 40.0 * std::numbers::pi / 180.0;

LiveOptions solver_options(const SkinOptions& options) {
  LiveOptions result;
  result.locality.locality = 0.0;  // a joint bends all that is near it
  result.seed = options.seed;
  result.threads = options.threads;
  return result;
}

Mat3 random_rotation(const Bone& bone, Random& random) {
  Vec3 turn = random.direction() * random.uniform(0.0, largest_angle);
  if (bone.limits)
    for (int k = 0; k < 3; ++k) turn[k] = random.uniform((*bone.limits)(k, 0), (*bone.limits)(k, 1));
  const double angle = turn.norm();
  return angle > 0.0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Mat3::Identity();
}

/// The handles of the bones that pull.
std::vector<Handle> pulling(const RigShape& rig) {
  std::vector<Handle> result;
  for (std::size_t b = 0; b < rig.handles.size(); ++b)
    if (rig.pulls[b]) result.push_back(rig.handles[b]);
  return result;
}

/// For intersecting surfaces, a rest shape whose interior paths do not join unrelated bones; else null.
std::shared_ptr<const RestShape> rest_shape(const RigShape& rig, std::uint64_t seed,
                                            const Progress& progress) {
  if (!rig.cuts_itself()) return nullptr;
  return std::make_shared<const RestShape>(rig.samples, true, seed, progress, -1, [&](Index i, Index j) {
    return rig.may_join(rig.sample_nodes[i], rig.sample_nodes[j]);
  });
}

}  // namespace

ExamplePoses::ExamplePoses(const RigShape& rig, PointsIn points, const SkinOptions& options,
                           const Progress& progress)
    : rig_(rig),
      solver_(rig.samples, pulling(rig), solver_options(options), progress,
              rest_shape(rig, options.seed, progress)),
      points_(points) {
  solver_.track(points);
}

void ExamplePoses::hold(const std::vector<Index>& near) {
  holders_.clear();
  for (Index i = 0; i < points_.rows(); ++i) holders_.push_back(rig_.holder(points_.row(i), near[i]));
}

ExamplePose ExamplePoses::draw(Random& random, const Vector& activity, const Progress& progress) {
  ExamplePose pose;
  for (Index b = 0; b < rig_.skeleton.count(); ++b) {
    const Bone& bone = rig_.skeleton.bone(b);
    const Mat3 rotation = random_rotation(bone, random);  // drawn for each, whether it is used or not
    const bool turns = bone.parent >= 0 && random.uniform() < activity[b];
    pose.rotations.push_back(turns ? rotation : Mat3::Identity());
  }
  pose.motions = rig_.skeleton.motions(pose.rotations);
  std::vector<Handle> moved;
  for (std::size_t b = 0; b < rig_.handles.size(); ++b) {
    if (!rig_.pulls[b]) continue;
    moved.push_back(rig_.handles[b]);
    moved.back().target = pose.motions[b] * moved.back().rest;
  }
  solver_.reset();
  solver_.set_targets(moved);
  solver_.follow(0, 0.0, progress);
  pose.shape = solver_.tracked();
  for (Index i = 0; i < static_cast<Index>(holders_.size()); ++i)
    if (const Index b = holders_[i]; b >= 0)
      pose.shape.row(i) =
          (pose.motions[b] * points_.row(i).transpose().homogeneous()).head<3>().cast<float>();
  return pose;
}

}  // namespace arapfields
