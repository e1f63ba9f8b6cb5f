// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// The triangles (m,3) of a mesh with their corners in the order that faces outwards; rows stay. Across
/// an edge of two triangles both face the same side, as the larger area of their patch does; a patch then
/// encloses a positive volume, also one with holes as large as that of half a sphere. One inside a patch that
/// is closed but for small holes, such as the wall of a cavity or an eyeball, is turned as that one is. A
/// sheet faces where most of it faced. Vertices at one position count as one.
/// `sheet_sizes`: is given for each triangle (m) the square root of its patch's area where the patch is a
/// sheet, with a boundary that is long for its area; 0 elsewhere.
Triangles outward_triangles(const TriangleMesh& mesh, Vector* sheet_sizes = nullptr);
/// The mesh with these triangles. Both throw InvalidInput as validate() does.
TriangleMesh facing_outwards(const TriangleMesh& mesh);

}  // namespace arapfields
