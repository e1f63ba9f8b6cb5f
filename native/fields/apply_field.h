// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/field.h"

namespace arapfields {

/// Applies a field to points (n,3) of another mesh of the same shape, coarser, finer or of other topology: x
/// + strength (f(x) − x), mesh coordinates. Throws InvalidInput naming `points` if over a tenth of them are
/// outside of the bounding box of the surface that the field was solved on, and farther than 0.1 of its size.
/// With `triangles` (m,3) the points are a mesh's vertices: where its parts touch at rest, each vertex moves
/// with the part that it belongs to. Throws InvalidInput as validate() does.
ARAPFIELDS_EXPORT Points apply_field(const DeformationField& field, PointsIn points, double strength = 1.0,
                                     const Triangles* triangles = nullptr);

}  // namespace arapfields
