// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Standard deviation of a scan's vertex noise (independent displacements along the normals), in mesh units.
/// 0 with too few vertices, and where noise cannot be separated from the shape: on clean and on coarse
/// meshes. Estimated by the covariance of neighbours' Laplacians, which noise makes negative and a smooth
/// surface positive; the shape's part follows from the difference of the estimates by first and second
/// Laplacians.
double vertex_noise(const TriangleMesh& mesh);

/// The vertices (n,3) smoothed without shrinking, by as much as they are noisy; the mesh's own without noise,
/// or if smoothing would move them farther than the noise. Source: Taubin 1995, "A Signal Processing Approach
/// to Fair Surface Design".
Points without_noise(const TriangleMesh& mesh);

}  // namespace arapfields
