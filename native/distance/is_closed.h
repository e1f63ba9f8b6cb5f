// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Whether every edge is passed as often in one direction as in the other, vertices at equal positions taken
/// as one: the soup is then a cycle, and its winding number is constant on every connected set that meets no
/// triangle. Needs neither manifold edges nor freedom from self-intersections.
bool is_closed(PointsIn vertices, TrianglesIn triangles);

}  // namespace arapfields
