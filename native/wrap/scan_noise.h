// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Standard deviation of what displaces a scan's vertices along their normals, each by itself, in mesh units.
/// 0 where too few vertices tell, and where it cannot be told from the shape itself: on clean and on coarse
/// meshes. Neighbours' second differences agree on a smooth surface; noise of one is in the other's with the
/// opposite sign. What the shape leaves is told by how far first and second differences disagree.
double vertex_noise(const TriangleMesh& mesh);

/// The vertices (n,3) smoothed without shrinking, by as much as they are noisy; the mesh's own where they are
/// not, or where that would move them further than noise does. Source: Taubin 1995, "A Signal Processing
/// Approach to Fair Surface Design".
Points without_noise(const TriangleMesh& mesh);

}  // namespace arapfields
