// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// An edge of one triangle that passes through the inside of another.
struct TriangleCrossing {
  std::int32_t edge_of;
  std::int32_t through;
  Vec3 edge_at;     ///< barycentric coordinates of the crossing in `edge_of`; one of them is 0
  Vec3 through_at;  ///< and in `through`
};

/// Finds where a soup crosses itself, in pairs of triangles without a common corner: vertices with equal
/// numbers in `same` (n) are one. The order does not depend on the number of threads. The coordinates must
/// fit single precision. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS std::vector<TriangleCrossing> triangle_crossings(
    const Points& vertices, TrianglesIn triangles, const std::vector<std::int32_t>& same,
    const Progress& progress = {});

}  // namespace arapfields
