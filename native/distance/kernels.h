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
/// For each segment the least t ∈ [0,1] at which from + t (to − from) meets a triangle; infinity if it meets
/// none. Edges and corners belong to their triangles; triangles without area, and those in a segment's own
/// plane, are not met. With `labels` (one for each triangle) a segment meets those of its own label alone.
ARAPFIELDS_DECLARE(void first_crossings(const HierarchyView& tree, const double* from, const double* to,
                                        std::int64_t count, const std::int32_t* labels,
                                        const std::int32_t* own_labels, double* results))
/// Bit j of links[i]: the empty balls about points i and j overlap. count ≤ linked_points.
ARAPFIELDS_DECLARE(void overlapping(const double* points, const Nearest* nearest, int count,
                                    std::uint64_t* links))

}  // namespace arapfields
