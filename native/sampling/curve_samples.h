// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/jets2d.h"

namespace arapfields {

/// Points on a curve of the plane, in order along it, with unit normals: outward where the curve is closed,
/// to the right of the direction of travel where it is open.
struct CurveSamples {
  Points2 points;   ///< (n,2)
  Points2 normals;  ///< (n,2)
};

/// `count` points at equal distances along the polygon with these vertices (m,2). The first is half a
/// distance after the first vertex. Throws InvalidInput for fewer than two (closed: three) vertices,
/// non-finite ones, no length, or count < 1.
ARAPFIELDS_EXPORT CurveSamples sample_curve(Points2In vertices, Index count, bool closed = true);

}  // namespace arapfields
