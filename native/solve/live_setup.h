// SPDX-License-Identifier: GPL-3.0-or-later
// Choices of samples, and alignment: what a live solver does besides minimising.
#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"
#include "core/types.h"

namespace arapfields {

/// `count` different numbers below n in random order (all of them where n is not larger).
std::vector<Index> random_subset(Index n, Index count, Random& random);

/// One random entry of each of `count` equal parts of the list: even coverage where the list is in spatial
/// order.
std::vector<Index> stratified(const std::vector<std::uint32_t>& list, Index count, Random& random);

Points rows_of(PointsIn points, const std::vector<Index>& rows);

/// The rigid motion of space after which points are nearest to their targets, and the factor by which it
/// lowers the weighted sum of their squared distances (1: not at all).
struct Alignment {
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();
  double gain = 1.0;
};
Alignment best_alignment(PointsIn points, PointsIn targets, const Vector& weights);

}  // namespace arapfields
