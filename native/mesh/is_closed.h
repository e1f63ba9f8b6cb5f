// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

/// For each vertex (n) the first at the same position.
std::vector<std::int32_t> first_at_position(PointsIn vertices);

/// Whether each edge is used by triangles equally often in both directions, with vertices welded by position:
/// the soup is then a cycle, and its winding number is constant on every connected set that meets no
/// triangle. Edges may be non-manifold, and triangles may intersect.
bool is_closed(PointsIn vertices, TrianglesIn triangles);

}  // namespace arapfields
