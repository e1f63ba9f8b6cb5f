// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"
#include "energies/distortion.h"
#include "energies/handles.h"

namespace arapfields {

/// A handle whose target is many sizes of the shape away from its rest position.
struct FarTarget {
  Index handle;
  double sizes;  ///< the distance, in sizes of the shape: the largest extent of its bounding box
};
/// The farthest of them, if any is far.
std::optional<FarTarget> far_target(const BoundHandles& handles, PointsIn samples);

/// InvalidInput for a target that is too far for the arithmetic to follow: a million sizes of the shape.
void require_within_reach(const BoundHandles& handles, PointsIn samples);

/// Sentences that warn of folds at the measured samples, of a far target, and of point handles that were
/// brought onto the surface.
std::vector<std::string> warnings_on(const Distortion& distortion, const std::optional<FarTarget>& far,
                                     const BoundHandles& handles);

}  // namespace arapfields
