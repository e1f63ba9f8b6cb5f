// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "extraction/sparse_grid.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// The zero surface of a refined grid in cube coordinates: one vertex on each edge whose ends differ in sign
/// (zero counts as outside), by linear interpolation; triangles counter-clockwise seen from outside. Where a
/// cell's face has alternating corners, the sign of the bilinear interpolant's saddle joins or separates
/// them (Nielson, Hamann 1991, "The asymptotic decider"), so that neighbouring cells agree: the surface is a
/// closed manifold unless it leaves the cube, where its boundary lies on the cube's faces. A corner and a
/// pair of corners separate on a face may be connected inside the cell (Chernyaev 1995, "Marching cubes 33",
/// case 6.1.2). Cells with such a tunnel, or with a polygon of eight or more corners, get a vertex of their
/// own, the mean of the cell's corners weighted by 1/|Φ|.
TriangleMesh marching_cubes(const SparseGrid& grid, const Progress& progress = {});

}  // namespace arapfields
