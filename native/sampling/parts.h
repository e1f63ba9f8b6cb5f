// SPDX-License-Identifier: GPL-3.0-or-later
// Disconnected parts of a sampled surface.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "core/export.h"
#include "core/types.h"

namespace arapfields {

/// The part of each point (n,3) of a surface: single-linkage clusters with a threshold of a few spacings.
std::vector<Index> parts_of(PointsIn points);

/// Rows of the nearest points of two parts; the first one's part is joined already.
using PartLink = std::pair<Index, Index>;

/// A predicate on two points, by their rows.
using MayJoin = std::function<bool(Index, Index)>;

/// The shortest lines that join all parts to those in `joined`, a minimum spanning forest (Prim 1957).
/// `parts` (n) has the part of each point (n,3). Lines between points that may not be joined are taken only
/// where there are no others; `may_join`: none: all may.
ARAPFIELDS_EXPORT_TO_TESTS std::vector<PartLink> spanning_links(PointsIn points,
                                                                const std::vector<Index>& parts,
                                                                std::vector<Index> joined,
                                                                const MayJoin& may_join = {});

}  // namespace arapfields
