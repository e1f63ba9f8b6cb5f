// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/skeleton.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/errors.h"

namespace arapfields {
namespace {

/// Tolerances of copies_length(), in lengths of the bone.
constexpr double same_length = 1e-4, apart = 1e-2;

/// Tolerance of bones in one place, in lengths of the longest bone.
constexpr double same_place = 1e-6;

double longest_of(const std::vector<Bone>& bones) {
  double longest = 0.0;
  for (const Bone& bone : bones) longest = std::max(longest, (bone.tail - bone.head).norm());
  return longest;
}

void require_bones(const std::vector<Bone>& bones) {
  require(std::ranges::any_of(bones, &Bone::deform), "bones", "none deforms", "at least one is needed");
  const Index n = static_cast<Index>(bones.size());
  const double longest = longest_of(bones);
  for (Index i = 0; i < n; ++i) {
    const Bone& bone = bones[i];
    const std::string name = bone.name.empty() ? "bones[" + std::to_string(i) + "]" : "bone " + bone.name;
    require(bone.head.allFinite() && bone.tail.allFinite() && std::isfinite(bone.roll), name,
            "NaN or infinity", "head, tail and roll must be finite");
    require(bone.parent >= -1 && bone.parent < n, name, "parent " + std::to_string(bone.parent),
            "-1 for none, or below " + std::to_string(n));
    Index steps = 0;
    for (Index p = bone.parent; p >= 0 && steps <= n; p = bones[p].parent) ++steps;
    require(steps <= n, name, "it is its own ancestor", "parents may not go in circles");
    if (bone.limits)
      require(bone.limits->allFinite() && (bone.limits->col(0).array() <= bone.limits->col(1).array()).all(),
              name, "limits that are not finite, or a lowest above a highest", "(3, 2) angles are needed");
    if (!bone.deform) continue;
    require((bone.tail - bone.head).norm() > same_place * longest, name, "it has no length",
            "head and tail must differ");
  }
}

/// Whether a bone begins apart from its parent's tail and is exactly as long.
bool copies_length(const Bone& bone, const Bone& parent) {
  const double length = (parent.tail - parent.head).norm();
  return std::abs((bone.tail - bone.head).norm() - length) < same_length * length &&
         (bone.head - parent.tail).norm() > apart * length;
}

}  // namespace

std::pair<Vec3, double> closest_on(const BonePart& part, const Vec3& point) {
  const Vec3 along = part.end - part.start;
  const double square = along.squaredNorm();
  const double t = square > 0.0 ? std::clamp((point - part.start).dot(along) / square, 0.0, 1.0) : 0.0;
  return {part.start + t * along, t};
}

std::vector<std::pair<Index, Index>> coincident_bones(const std::vector<Bone>& bones) {
  require_bones(bones);
  const Index n = static_cast<Index>(bones.size());
  const double near = same_place * longest_of(bones);
  const auto from_parent = [&](Index i) {
    const Index parent = bones[i].parent;
    return parent < 0
               ? std::numeric_limits<double>::infinity()
               : (closest_on({bones[parent].head, bones[parent].tail}, bones[i].head).first - bones[i].head)
                     .norm();
  };
  std::vector<Index> kept;  // for each bone so far the one at its place
  for (Index i = 0; i < n; ++i) {
    Index at = i;
    for (Index j = 0; j < i && at == i && bones[i].deform; ++j)
      if (bones[j].deform && (bones[j].head - bones[i].head).norm() <= near &&
          (bones[j].tail - bones[i].tail).norm() <= near)
        at = kept[j];
    kept.push_back(at);
    if (at != i && from_parent(i) < from_parent(at) - near) std::ranges::replace(kept, at, i);
  }
  std::vector<std::pair<Index, Index>> result;
  for (Index i = 0; i < n; ++i)
    if (kept[i] != i) result.emplace_back(i, kept[i]);
  return result;
}

Skeleton::Skeleton(std::vector<Bone> bones) {
  for (const auto& [bone, at] : coincident_bones(bones)) bones[bone].deform = false;
  std::vector<Index> place(bones.size(), -1);
  for (std::size_t i = 0; i < bones.size(); ++i)
    if (bones[i].deform) {
      place[i] = count();
      bones_.push_back(bones[i]);
      original_.push_back(static_cast<Index>(i));
    }
  for (Bone& bone : bones_) {
    while (bone.parent >= 0 && !bones[bone.parent].deform) bone.parent = bones[bone.parent].parent;
    if (bone.parent >= 0) bone.parent = place[bone.parent];
  }
  for (const Bone& bone : bones_) parts_.push_back({{bone.head, bone.tail}});
  joined_.assign(bones_.size(), false);
  join_roots();
  leaf_.assign(bones_.size(), true);
  for (const Bone& bone : bones_)
    if (bone.parent >= 0) leaf_[bone.parent] = false;
  for (Index b = 0; b < count(); ++b) {
    const Index parent = bones[original_[b]].parent;
    open_.push_back(leaf_[b] && parent >= 0 && copies_length(bones_[b], bones[parent]));
  }
  std::vector<Index> depth(bones_.size(), 0);
  for (Index b = 0; b < count(); ++b)
    for (Index p = bones_[b].parent; p >= 0; p = bones_[p].parent) ++depth[b];
  for (Index b = 0; b < count(); ++b) order_.push_back(b);
  std::ranges::stable_sort(order_, {}, [&](Index b) { return depth[b]; });
}

void Skeleton::join_roots() {
  std::vector<Index> root(bones_.size()), size(bones_.size(), 0);
  for (Index b = 0; b < count(); ++b) {
    for (root[b] = b; bones_[root[b]].parent >= 0;) root[b] = bones_[root[b]].parent;
    ++size[root[b]];
  }
  const Index main = std::max_element(size.begin(), size.end()) - size.begin();
  for (;;) {  // the tree whose root is nearest to the main one joins it
    double least = std::numeric_limits<double>::infinity();
    Index joining = -1, to = -1;
    for (Index r = 0; r < count(); ++r)
      for (Index b = 0; b < count() && root[r] == r && r != main; ++b) {
        if (root[b] != main) continue;
        const double distance = (nearest(b, bones_[r].head) - bones_[r].head).norm();
        if (distance < least) least = distance, joining = r, to = b;
      }
    if (joining < 0) return;
    bones_[joining].parent = to;
    joined_[joining] = true;
    std::ranges::replace(root, joining, main);
  }
}

Mat3 bone_axes(const Bone& bone) {
  const Vec3 y = (bone.tail - bone.head).normalized();
  Mat3 shortest = Vec3(-1.0, -1.0, 1.0).asDiagonal();  // the bone points along −y: Blender's convention
  if (y[1] > -1.0 + 1e-9) {
    const double w = std::sqrt(0.5 * (1.0 + y[1]));  // the cosine of half the angle to the y axis
    shortest = Eigen::Quaterniond(w, 0.5 * y[2] / w, 0.0, -0.5 * y[0] / w).toRotationMatrix();
  }
  return Eigen::AngleAxisd(bone.roll, y) * shortest;
}

Mat4 bone_box(const Bone& bone) {
  Mat4 box = Mat4::Identity();
  box.topLeftCorner<3, 3>() = bone_axes(bone) * (0.5 * (bone.tail - bone.head).norm());
  box.topRightCorner<3, 1>() = 0.5 * (bone.head + bone.tail);
  return box;
}

std::vector<Mat4> Skeleton::motions(const std::vector<Mat3>& rotations) const {
  std::vector<Mat4> result(bones_.size(), Mat4::Identity());
  for (const Index b : order_) {
    const Mat3 axis = bone_axes(bones_[b]), turn = axis * rotations[b] * axis.transpose();
    Mat4 local = Mat4::Identity();
    local.topLeftCorner<3, 3>() = turn;
    local.topRightCorner<3, 1>() = bones_[b].head - turn * bones_[b].head;
    result[b] = bones_[b].parent < 0 ? local : result[bones_[b].parent] * local;
  }
  return result;
}

Skeleton::Symmetry Skeleton::symmetry(double tolerance) const {
  Symmetry best;
  best.mirrored.assign(bones_.size(), -1);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> places;
    for (const Bone& bone : bones_) places.push_back(bone.head[axis]);
    std::ranges::sort(places);
    // Candidate planes: midway between the outermost heads, through the middle head, and through the origin.
    for (const double offset : {0.5 * (places.front() + places.back()), places[places.size() / 2], 0.0}) {
      Symmetry found{axis, offset, {}, 0};
      const auto reflected = [&](Vec3 p) {
        p[axis] = 2.0 * offset - p[axis];
        return p;
      };
      for (Index b = 0; b < count(); ++b) {
        const Vec3 head = reflected(bones_[b].head), tail = reflected(bones_[b].tail);
        Index twin = -1;
        for (Index other = 0; other < count(); ++other) {
          if (!((bones_[other].head - head).norm() < tolerance)) continue;
          const bool whole = (bones_[other].tail - tail).norm() < tolerance;
          if (whole || (twin < 0 && !reaches_tail(b) && !reaches_tail(other))) twin = other;
          if (whole) break;
        }
        found.mirrored.push_back(twin);
      }
      for (Index b = 0; b < count(); ++b)
        if (const Index twin = found.mirrored[b]; twin >= 0 && found.mirrored[twin] != b)
          found.mirrored[b] = -1;
      for (Index b = 0; b < count(); ++b)
        if (found.mirrored[b] >= 0 && found.mirrored[b] != b) ++found.pairs;
      if (found.pairs > best.pairs) best = std::move(found);
    }
  }
  return best;
}

std::vector<Vec3> Skeleton::joints(Index b) const {
  std::vector<Vec3> result;
  const double least = apart * (bones_[b].tail - bones_[b].head).norm();
  for (Index child = 0; child < count(); ++child) {
    const Vec3& joint = bones_[child].head;
    const auto ends_there = [&](const Bone& other) {
      return other.parent == b && (other.tail - joint).norm() <= least;
    };
    if (bones_[child].parent == b && !joined_[child] && (joint - bones_[b].head).norm() > least &&
        (joint - bones_[b].tail).norm() > least && std::ranges::none_of(bones_, ends_there))
      result.push_back(joint);
  }
  return result;
}

bool Skeleton::reaches_tail(Index b) const {
  return std::ranges::any_of(parts_[b], [&](const BonePart& part) { return part.end == bones_[b].tail; });
}

std::pair<Vec3, double> Skeleton::closest(Index b, const Vec3& point) const {
  std::pair<Vec3, double> best = closest_on(parts_[b].front(), point);
  for (std::size_t k = 1; k < parts_[b].size(); ++k) {
    const std::pair<Vec3, double> other = closest_on(parts_[b][k], point);
    if ((other.first - point).squaredNorm() < (best.first - point).squaredNorm()) best = other;
  }
  return best;
}

}  // namespace arapfields
