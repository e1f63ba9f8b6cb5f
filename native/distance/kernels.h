// SPDX-License-Identifier: GPL-3.0-or-later
// Kernels over the hierarchy, compiled for each instruction set. Points are x, y, z triples in the
// hierarchy's coordinates; neighbours in space should be neighbours in the list.
#pragma once

#include <cstdint>

#include "core/simd.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// At most so many points can be linked at a time.
constexpr int linked_points = 64;

/// Nearest triangle of each point.
ARAPFIELDS_DECLARE(void nearest(const HierarchyView& tree, const double* points, std::int64_t count,
                                Nearest* results))
/// The same by brute force over all packets: the reference that nearest() must equal bit for bit.
ARAPFIELDS_DECLARE(void nearest_of_all(const HierarchyView& tree, const double* points, std::int64_t count,
                                       Nearest* results))
/// Winding number of each point. A child is replaced by its moments where the distance to its center exceeds
/// `opening` times its radius. `remainders`, if not null, gets the sum over replaced children of
/// area / (4π R²) · (radius / R)⁴, the scale of the truncation error.
ARAPFIELDS_DECLARE(void winding(const HierarchyView& tree, const double* points, std::int64_t count,
                                double opening, double* numbers, double* remainders))
/// Bit j of links[i]: the empty balls about points i and j overlap. count ≤ linked_points.
ARAPFIELDS_DECLARE(void overlapping(const double* points, const Nearest* nearest, int count,
                                    std::uint64_t* links))

}  // namespace arapfields
