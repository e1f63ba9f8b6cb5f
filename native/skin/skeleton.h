// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// A bone at rest, in mesh coordinates. Its y axis runs from head to tail, and `roll` turns the others about
/// it as in Blender.
struct Bone {
  Vec3 head = Vec3::Zero();
  Vec3 tail = Vec3::UnitY();
  Index parent = -1;   ///< among all bones; −1 for none
  double roll = 0.0;   ///< radians
  bool deform = true;  ///< whether it may have weights; helpers only join others
  /// Lowest and highest rotation (3,2) about the bone's own axes, as a rotation vector in radians.
  std::optional<Eigen::Matrix<double, 3, 2>> limits = std::nullopt;
  std::string name = {};  ///< for messages
};

/// A bone's axes as columns, and the map of the cube [-1,1]³ to a box as long as the bone: a handle's rest.
Mat3 bone_axes(const Bone& bone);
ARAPFIELDS_EXPORT Mat4 bone_box(const Bone& bone);

/// A straight part of a bone.
struct BonePart {
  Vec3 start;
  Vec3 end;
};

/// The point of a part closest to another, and its parameter, 0 at the start and 1 at the end.
std::pair<Vec3, double> closest_on(const BonePart& part, const Vec3& point);

/// The deforming bones that lie where another does, as control bones do, and the one that they lie at. This
/// is the one nearest to its parent, of several the first.
ARAPFIELDS_EXPORT std::vector<std::pair<Index, Index>> coincident_bones(const std::vector<Bone>& bones);

/// The deforming bones of a rig; of those that lie in one place only one is kept. A bone's parent is its
/// nearest deforming ancestor. If there are several roots, all but that of the largest tree become children
/// of the bone nearest to their heads.
class Skeleton {
 public:
  /// Throws InvalidInput that names the bone: none deforms, numbers that are not finite, parents out of range
  /// or in a circle, no length.
  explicit Skeleton(std::vector<Bone> bones);

  Index count() const { return static_cast<Index>(bones_.size()); }
  const Bone& bone(Index b) const { return bones_[b]; }  ///< its parent is among the deforming ones
  Index original(Index b) const { return original_[b]; }
  bool is_leaf(Index b) const { return leaf_[b]; }
  /// Whether only the head is known: importers of joints give the last bone of a chain its parent's length.
  bool has_open_end(Index b) const { return open_[b]; }
  /// Motions (bones) from rest, from each bone's rotation in its own axes.
  std::vector<Mat4> motions(const std::vector<Mat3>& rotations) const;
  /// The mirrored bone of each (−1: none) across the coordinate plane with the most pairs. Of bones that end
  /// before their tails the heads count.
  struct Symmetry {
    int axis = 0;
    double offset = 0.0;
    std::vector<Index> mirrored;
    Index pairs = 0;
    bool is_whole() const { return pairs > 0 && std::ranges::find(mirrored, -1) == mirrored.end(); }
  };
  Symmetry symmetry(double tolerance) const;
  /// The heads of a bone's children, but those where it or another child ends.
  std::vector<Vec3> joints(Index b) const;
  /// The parts of a bone, first one from head to tail; a shape has only those inside of it.
  const std::vector<BonePart>& parts(Index b) const { return parts_[b]; }
  void set_parts(Index b, std::vector<BonePart> parts) { parts_[b] = std::move(parts); }
  /// The closest point of a bone's parts, and its parameter, 0 at the start of its part and 1 at the end.
  Vec3 nearest(Index b, const Vec3& point) const { return closest(b, point).first; }
  double along(Index b, const Vec3& point) const { return closest(b, point).second; }

 private:
  bool reaches_tail(Index b) const;
  std::pair<Vec3, double> closest(Index b, const Vec3& point) const;
  void join_roots();

  std::vector<Bone> bones_;
  std::vector<Index> original_;
  std::vector<Index> order_;  // parents first
  std::vector<bool> leaf_;
  std::vector<bool> open_;
  std::vector<bool> joined_;  // whether join_roots() gave it its parent
  std::vector<std::vector<BonePart>> parts_;
};

}  // namespace arapfields
