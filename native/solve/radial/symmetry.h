// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/surface_samples.h"
#include "options/choices.h"

namespace arapfields {

/// 0, 1 or 2; −1 for none.
inline int axis_of(SymmetryPlane plane) { return static_cast<int>(plane) - 1; }

/// The samples in a frame whose center lies on the plane of mesh coordinates where one of them is 0: there a
/// reflection across it changes a sign and rounds nothing.
inline SurfaceSamples across(const SurfaceSamples& samples, int axis) {
  SurfaceSamples result = samples;
  result.points.col(axis).array() += samples.frame.center[axis] / samples.frame.scale;
  result.frame.center[axis] = 0.0;
  result.redraw = nullptr;  // its samples are in the other frame
  return result;
}

}  // namespace arapfields
