// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// Rows of points (p,3) of a surface that lie outside of the convex hull of the samples (n,3) around them by
/// more than `least`, as tips and edges do. `normals` (n,3) are the samples'; what stands out inwards is left
/// out. Of those that stand out together only the foremost, and `most` at most. `spacing` is about the
/// distance of neighbouring samples. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS std::vector<Index> standing_out(PointsIn points, PointsIn samples,
                                                           PointsIn normals, double spacing, double least,
                                                           Index most, const Progress& progress = {});

}  // namespace arapfields
