// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <bitset>
#include <vector>

#include "skin/bone_regions.h"

namespace arapfields {

/// The visibility of surfaces from a place, by cube maps: a depth buffer and the covered directions of each.
class BoneSight {
  static constexpr int wide = 2;  // cells along an edge of the coarse cube map
  static constexpr int fine = 6;  // of the depth buffer

 public:
  static constexpr int all_sides = 6 * wide * wide;

  /// Renders the points whose surface has one of `count` slots; `slots` maps surfaces to slots, −1: none.
  BoneSight(const PiecePoints& surfaces, const std::vector<Index>& slots, Index count, const Vec3& place);

  /// Number of coarse cells (directions) that a surface covers.
  int sides(Index slot) const { return static_cast<int>(sides_[static_cast<std::size_t>(slot)].count()); }
  /// Whether a point is not occluded by its own surface; `tolerance` is a length.
  bool sees(const Vec3& point, Index slot, double tolerance) const;

 private:
  Vec3 place_;
  std::vector<std::bitset<all_sides>> sides_;
  std::vector<std::array<float, 6 * fine * fine>> depths_;
};

}  // namespace arapfields
