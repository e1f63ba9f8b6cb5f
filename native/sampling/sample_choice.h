// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"
#include "core/types.h"

// Selection of subsets of samples.

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

/// Indices of the points along a Z-order curve in their principal axes, so that neighbours in the list are
/// neighbours in space. The order does not change when the points are rotated, moved, scaled or mirrored, and
/// hardly changes when a few outliers are added.
std::vector<std::uint32_t> canonical_order(PointsIn points);

/// `count` evenly spaced numbers from 0 to size − 1, or all if there are no more.
std::vector<Index> evenly(Index size, Index count);
/// `count` evenly spaced entries of the list, or all if it has no more.
std::vector<Index> evenly(const std::vector<std::uint32_t>& list, Index count);

}  // namespace arapfields
