// SPDX-License-Identifier: GPL-3.0-or-later
// Choices of samples.
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

/// The rows of points (n,3) that lie far from all of the chosen ones: of loose parts that were missed.
std::vector<Index> missed_rows(PointsIn points, const std::vector<Index>& chosen);

Points rows_of(PointsIn points, const std::vector<Index>& rows);
Vector entries_of(const Vector& numbers, const std::vector<Index>& rows);

}  // namespace arapfields
