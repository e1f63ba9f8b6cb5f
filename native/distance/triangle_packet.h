// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// Fills a packet with 1 to 8 triangles: corners[3 i + 0..2] and the number of triangle i.
void fill(TrianglePacket& packet, const Vec3* corners, const std::int32_t* numbers, int count);

/// The point of the triangle in a packet's lane that is closest to `point`.
Vec3 closest_point(const TrianglePacket& packet, int lane, const Vec3& point);

}  // namespace arapfields
