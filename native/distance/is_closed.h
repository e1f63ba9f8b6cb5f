// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

/// For each vertex (n) the first at the same position.
std::vector<std::int32_t> first_at_position(PointsIn vertices);

/// Whether every edge is passed as often in one direction as in the other, vertices at equal positions taken
/// as one: the soup is then a cycle, and its winding number is constant on every connected set that meets no
/// triangle. Needs neither manifold edges nor freedom from self-intersections.
bool is_closed(PointsIn vertices, TrianglesIn triangles);

}  // namespace arapfields
