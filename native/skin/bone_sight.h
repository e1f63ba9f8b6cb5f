// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <bitset>
#include <vector>

#include "skin/bone_regions.h"

namespace arapfields {

/// What is seen of surfaces from a place: how far away they are in each direction.
class BoneSight {
  static constexpr int wide = 2;  // cells of a cube's edge
  static constexpr int fine = 6;

 public:
  static constexpr int all_sides = 6 * wide * wide;

  /// Of the points those whose surface has one of `count` slots, by the number of the surface; −1: none.
  BoneSight(const PiecePoints& surfaces, const std::vector<Index>& slots, Index count, const Vec3& place);

  /// On how many sides of the place a surface lies.
  int sides(Index slot) const { return static_cast<int>(sides_[static_cast<std::size_t>(slot)].count()); }
  /// Whether nothing of a point's own surface hides it; `tolerance` is a length.
  bool sees(const Vec3& point, Index slot, double tolerance) const;

 private:
  Vec3 place_;
  std::vector<std::bitset<all_sides>> sides_;
  std::vector<std::array<float, 6 * fine * fine>> depths_;
};

}  // namespace arapfields
