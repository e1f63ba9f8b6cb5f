// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/frame.h"
#include "core/types.h"

namespace arapfields {

/// Points distributed uniformly over a rest surface, in cube coordinates, with outward unit normals.
struct SurfaceSamples {
  Points points;   ///< (n,3)
  Points normals;  ///< (n,3)
  Frame frame;     ///< cube ↔ mesh coordinates; fields solved on the samples inherit it
  Index size() const { return points.rows(); }
};

}  // namespace arapfields
