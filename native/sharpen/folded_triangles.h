// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "sharpen/welded_surface.h"

namespace arapfields {

/// Rows of the triangles that face away from where their corners' rotations turn them, in ascending order. A
/// corner's rotation is the one that fits the edges around its vertex best. Triangles without area are left
/// out. Throws InvalidInput for a broken mesh, and for moved vertices (n,3) that do not fit or are not
/// finite.
ARAPFIELDS_EXPORT std::vector<Index> folded_triangles(PointsIn vertices, TrianglesIn triangles,
                                                      PointsIn moved);

/// Whether a triangle faces away from where these rotations of the nodes turn it.
bool is_folded(const WeldedSurface& surface, Index triangle, const Points& positions,
               const std::vector<Mat3>& rotations);

/// The same with the rotations of its corners that fit these positions best.
bool is_folded(const WeldedSurface& surface, Index triangle, const Points& positions);

/// The triangles of the surface that are folded: one char for each.
std::vector<char> all_folded(const WeldedSurface& surface, const Points& positions,
                             const std::vector<Mat3>& rotations);

/// As many vertices as the mesh has, all finite; throws InvalidInput that names `moved`.
void require_moved(PointsIn vertices, PointsIn moved);

}  // namespace arapfields
