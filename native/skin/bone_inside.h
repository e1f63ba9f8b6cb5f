// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "skin/bone_regions.h"
#include "skin/skeleton.h"

namespace arapfields {

/// A view point is inside of a surface that covers at least so many of the 24 directions.
inline constexpr int enough_sides = 21;

/// View points along a segment of this length, as fractions of it: the middles of equal intervals.
std::vector<double> shares_along(double length, double spacing);

/// The surfaces about the bones of a shape, and the box of their points. Borrows its arguments.
struct BoneSurroundings {
  /// `slots` map the surfaces that may contain bones to `count` slots, −1: none; `spacing` is the nodes'.
  BoneSurroundings(const PiecePoints& surfaces, const std::vector<Index>& slots, Index count, double spacing);

  const PiecePoints& surfaces;
  const std::vector<Index>& slots;
  Index count;
  double spacing;
  Vec3 low;   ///< corner of the box
  Vec3 high;  ///< the opposite corner
};

/// The parts of a bone inside of the surfaces that contain it. A bone reaches to its tail and to the heads of
/// its children. One whose tail is outside, as importers of joints place them, ends at the children instead,
/// or without any where it leaves the shape.
class BoneInside {
 public:
  BoneInside(const Skeleton& skeleton, Index bone, const BoneSurroundings& around);

  /// Empty if no surface encloses a part of the bone.
  const std::vector<BonePart>& parts() const { return parts_; }
  /// Whether a point of the surface with this slot (−1: none) is visible from a part inside of that surface.
  bool sees(const Vec3& point, Index slot) const;

 private:
  /// A segment that begins at the head, and its view points.
  struct Segment {
    Segment(const BonePart& all, const std::vector<double>& shares, const BoneSurroundings& around);
    /// For each slot the view points from the first inside of its surface to where the bone leaves it.
    std::vector<std::pair<std::size_t, std::size_t>> runs;
    std::vector<BoneSight> views;
    BonePart all;

    bool is_inside(std::size_t view) const;
    /// Ends where it leaves the shape for the first time.
    void leave();
    std::size_t length(Index slot) const;
    BonePart part(Index slot) const;
  };

  Segment towards(const Vec3& end) const;
  void find_segments(const Skeleton& skeleton, Index bone);
  void find_surfaces();
  void take_most_covering();

  const BoneSurroundings& around_;
  Vec3 head_;
  std::vector<Segment> segments_;
  std::vector<char> contains_;  // whether the surface of a slot contains the bone
  std::vector<BonePart> parts_;
};

}  // namespace arapfields
