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
/// closed manifold unless it leaves the cube, where its boundary lies on the cube's faces. A cell that it
/// passes in one polygon of eight or more corners gets a further vertex, their mean.
TriangleMesh marching_cubes(const SparseGrid& grid, const Progress& progress = {});

}  // namespace arapfields
