// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of a surface that are apart.
#pragma once

#include <utility>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// The part, from 0 on, that each point (n,3) of a surface lies in: points are of one part where steps of a
/// few spacings lead from one to the other.
std::vector<Index> parts_of(PointsIn points);

/// Rows of points in two parts: that of the part which is joined already, and the other's nearest one.
using PartLink = std::pair<Index, Index>;

/// The shortest lines that join all parts to those in `joined`, a minimum spanning forest (Prim 1957).
/// `parts` (n) has the part of each point (n,3).
std::vector<PartLink> spanning_links(PointsIn points, const std::vector<Index>& parts,
                                     std::vector<Index> joined);

}  // namespace arapfields
