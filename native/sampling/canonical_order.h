// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// Indices of the points along a Z-order curve in their principal axes, so that neighbours in the list are
/// neighbours in space. The order does not change when the points are rotated, moved, scaled or mirrored, and
/// hardly changes when a few outliers are added.
std::vector<std::uint32_t> canonical_order(PointsIn points);

/// `count` evenly spaced entries of the list, or all if it has no more.
std::vector<Index> evenly(const std::vector<std::uint32_t>& list, Index count);

}  // namespace arapfields
