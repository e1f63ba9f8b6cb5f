// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/triangle_mesh.h"

namespace arapfields {

/// The connected piece of each triangle (m) of a mesh whose triangles face outwards, numbered from 0.
/// Triangles are joined across an edge of two. Where more meet at one edge, each is joined with the next one
/// around it on its inner side: solids that touch along faces or edges are pieces of their own. Open pieces
/// that share a position of a vertex are one.
ARAPFIELDS_EXPORT_TO_TESTS std::vector<std::int32_t> pieces_of(const TriangleMesh& mesh);

/// For each vertex (n) the first of those in its place that triangles around it join with it, across edges as
/// above: along a seam they are one, on two sides of a closed slit they are not.
ARAPFIELDS_EXPORT_TO_TESTS std::vector<std::int32_t> joined_vertices(const TriangleMesh& mesh);

}  // namespace arapfields
