// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// The points' numbers in the order of a Z-curve along their own principal axes, so that neighbours in the
/// list are neighbours in space: the same order however the points are turned, moved, scaled or mirrored, and
/// nearly the same where few more of them lie far away.
std::vector<std::uint32_t> canonical_order(PointsIn points);

/// `count` of the list's entries in equal steps (all of them where it has no more).
std::vector<Index> evenly(const std::vector<std::uint32_t>& list, Index count);

}  // namespace arapfields
