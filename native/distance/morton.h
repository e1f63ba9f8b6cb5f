// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// The points' numbers in the order of a Z-curve over their bounding box (1024 cells a side), so that
/// neighbours in the list are neighbours in space. At most 2³² points, finite.
std::vector<std::uint32_t> morton_order(PointsIn points);

}  // namespace arapfields
