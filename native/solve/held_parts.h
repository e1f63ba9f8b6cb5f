// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

class BoundHandles;

/// The parts of a surface: of each of some sites (sampling/parts.h); a place belongs to that of the nearest.
struct SurfaceParts {
  PointsIn sites;
  const std::vector<Index>& parts;
};

/// Factors (n) of samples in the energy that holds them in place: 0 for those that a handle takes along, and
/// on parts of the surface that hold none of the places `held` and follow others; 1 elsewhere. `rows` has
/// their numbers among the samples of `handles`.
Vector locality_shares(PointsIn points, const std::vector<Index>& rows, const BoundHandles& handles,
                       PointsIn held, const SurfaceParts& surface);

}  // namespace arapfields
