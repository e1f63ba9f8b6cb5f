// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <string>
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

/// The deforming bones of a rig; a bone's parent is its nearest deforming ancestor. If there are several
/// roots, all but that of the largest tree become children of the bone nearest to their heads.
class Skeleton {
 public:
  /// Throws InvalidInput that names the bone: none deforms, numbers that are not finite, parents out of range
  /// or in a circle, no length, two in one place.
  explicit Skeleton(const std::vector<Bone>& bones);

  Index count() const { return static_cast<Index>(bones_.size()); }
  const Bone& bone(Index b) const { return bones_[b]; }  ///< its parent is among the deforming ones
  Index original(Index b) const { return original_[b]; }
  bool is_leaf(Index b) const { return leaf_[b]; }
  /// Whether only the head is known: importers of joints give the last bone of a chain its parent's length.
  bool has_open_end(Index b) const { return open_[b]; }
  /// Motions (bones) from rest, from each bone's rotation in its own axes.
  std::vector<Mat4> motions(const std::vector<Mat3>& rotations) const;
  /// The mirrored bone of each (−1: none) across the coordinate plane with the most pairs.
  struct Symmetry {
    int axis = 0;
    double offset = 0.0;
    std::vector<Index> mirrored;
    Index pairs = 0;
    bool is_whole() const { return pairs > 0 && std::ranges::find(mirrored, -1) == mirrored.end(); }
  };
  Symmetry symmetry(double tolerance) const;
  /// Parameter of the bone's closest point, 0 at its head and 1 at its tail.
  double along(Index b, const Vec3& point) const;
  Vec3 nearest(Index b, const Vec3& point) const { return place(b, along(b, point)); }

 private:
  Vec3 place(Index b, double t) const { return bones_[b].head + t * (bones_[b].tail - bones_[b].head); }
  void join_roots();

  std::vector<Bone> bones_;
  std::vector<Index> original_;
  std::vector<Index> order_;  // parents first
  std::vector<bool> leaf_;
  std::vector<bool> open_;
};

}  // namespace arapfields
