// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "mesh/surface_samples.h"
#include "splats/gaussian_splats.h"

namespace arapfields {

/// Samples of the surface that splats show, at most `count`: centers of opaque splats, one for each cell of a
/// grid, with the shortest axes nearby as normals. Normals agree along a minimum spanning tree (Hoppe et al.
/// 1992) and point outward where a part is outermost. Parts with less than 1 % of the samples are left out,
/// as floating splats are in most scans. Throws InvalidInput for splats that do not fit together and where
/// fewer than ten are opaque, and Cancelled.
ARAPFIELDS_EXPORT SurfaceSamples sample_splats(const GaussianSplats& splats, Index count = 20000,
                                               const Progress& progress = {});

}  // namespace arapfields
