// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"
#include "energies/distortion.h"
#include "energies/handles.h"

namespace arapfields {

/// A handle whose target is so far from its place at rest that the shape can only be torn after it.
struct FarTarget {
  Index handle;
  double sizes;  ///< the way in sizes of the shape: the largest extent of the samples' bounding box
};
/// The farthest of them, if any is far.
std::optional<FarTarget> far_target(const BoundHandles& handles, PointsIn samples);

/// Sentences on what a result should not be used without knowing: folds at the samples that it was measured
/// at, and a far target.
std::vector<std::string> notes_on(const Distortion& distortion, const std::optional<FarTarget>& far);

}  // namespace arapfields
