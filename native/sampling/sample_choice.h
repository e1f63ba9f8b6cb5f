// SPDX-License-Identifier: GPL-3.0-or-later
// Selection of subsets of samples.
#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"
#include "core/types.h"

namespace arapfields {

/// `count` distinct numbers below n in random order, or all if n is not larger.
std::vector<Index> random_subset(Index n, Index count, Random& random);

/// Stratified sampling: one random entry of each of `count` equal parts of the list, for even coverage if the
/// list is in spatial order.
std::vector<Index> stratified(const std::vector<std::uint32_t>& list, Index count, Random& random);

/// The rows of points (n,3) that are far from all chosen ones: those of small parts without a chosen point.
std::vector<Index> missed_rows(PointsIn points, const std::vector<Index>& chosen);

Points rows_of(PointsIn points, const std::vector<Index>& rows);
Vector entries_of(const Vector& numbers, const std::vector<Index>& rows);

}  // namespace arapfields
