// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// Rows of points (p,3) of a surface that are farther than `least` outside of the convex hull of the samples
/// (n,3) around them: tips and edges. `normals` (n,3) are the samples'; points on the inner side are left
/// out. Of neighbouring ones only the farthest is taken, and at most `most` in all. `spacing` is the mean
/// distance of neighbouring samples. Throws Cancelled.
ARAPFIELDS_EXPORT_TO_TESTS std::vector<Index> standing_out(PointsIn points, PointsIn samples,
                                                           PointsIn normals, double spacing, double least,
                                                           Index most, const Progress& progress = {});

}  // namespace arapfields
