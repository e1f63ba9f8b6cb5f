// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"
#include "distance/signed_distance.h"

namespace arapfields {

/// The soup of triangles that are samples (n,3) of a surface: the nearest of them is the nearest sample.
SignedDistance nearest_samples(PointsIn samples, const Progress& progress = {});

/// Distances (p) of points (p,3) to the nearest sample.
Vector nearest_distances(PointsIn samples, PointsIn points, const Progress& progress = {});

/// About the length of a body, from samples of it: 2.5 radii of gyration, which no turn changes and small
/// things far away hardly do; 1 where all samples are one.
double body_size(PointsIn samples);

}  // namespace arapfields
