// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

/// Which points (n,3) of a surface lie on a part of it that is held: 1 there, 0 on parts that nothing holds
/// and that follow others; empty where the surface is one part. `parts` has the part of each of some sites
/// (sampling/parts.h), `held` are places of handles; a place belongs to the part of the nearest site.
Vector held_shares(PointsIn points, PointsIn sites, const std::vector<Index>& parts, PointsIn held);

}  // namespace arapfields
