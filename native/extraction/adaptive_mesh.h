// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "extraction/fine_grid.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Coarse cells beside those that are cut up in which the surface is not what their own corners say: it
/// passes an edge twice, or comes in through a face and they do not see it. Cut up too, they leave the mesh
/// as it is between coarse cells and fine ones.
std::set<Place> cells_to_cut(const FineGrid& grid);

/// Marching cubes on coarse cells and, where they are cut up, on fine ones, in cube coordinates. A coarse
/// cell beside fine ones takes over the curves in which the surface cuts their faces, and fills the loops
/// that the curves on all its faces form (as in Kazhdan, Klein, Dalal, Hoppe 2007, "Unconstrained isosurface
/// extraction on arbitrary octrees"): both sides of a face have the same curve, so that there are no cracks
/// and the mesh is a manifold.
TriangleMesh adaptive_mesh(const FineGrid& grid);

}  // namespace arapfields
