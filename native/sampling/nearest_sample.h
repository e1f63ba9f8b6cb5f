// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"
#include "distance/signed_distance.h"

namespace arapfields {

/// The distance to samples (n,3) of a surface, as degenerate triangles: the closest triangle is the sample.
SignedDistance nearest_samples(PointsIn samples, const Progress& progress = {});

/// Distances (p) of points (p,3) to the nearest sample.
Vector nearest_distances(PointsIn samples, PointsIn points, const Progress& progress = {});

/// The approximate length of a body: 2.5 radii of gyration of its samples, which is invariant under rotation
/// and insensitive to small outliers; 1 if all samples coincide.
double body_size(PointsIn samples);

}  // namespace arapfields
