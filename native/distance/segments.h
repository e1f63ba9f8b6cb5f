// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// The least t ∈ [0,1] at which from + t (to − from) meets a triangle, in the hierarchy's coordinates;
/// infinity if it meets none. Edges and corners belong to their triangles; triangles without area, and those
/// in the segment's own plane, are not met. With `labels` (one for each triangle) triangles of other labels
/// than `label` are ignored.
double first_crossing(const HierarchyView& tree, const Vec3& from, const Vec3& to,
                      const std::int32_t* labels = nullptr, std::int32_t label = 0);

}  // namespace arapfields
