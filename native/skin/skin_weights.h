// SPDX-License-Identifier: GPL-3.0-or-later
// Weights of linear blend skinning, from poses of the field.
#pragma once

#include <vector>

#include "core/task.h"
#include "mesh/sample_mesh.h"
#include "mesh/surface_samples.h"
#include "mesh/triangle_mesh.h"
#include "options/skin.h"
#include "skin/skeleton.h"

namespace arapfields {

/// Weights (n, bones) of a mesh's vertices: ≥ 0, of sum one, at most options.influences of them above 0 a
/// vertex. They are a least-squares fit of linear blend skinning to the field, whose handles are the bones,
/// over example poses. They do not depend on connectivity: several meshes may be concatenated. Small closed
/// pieces move rigidly. A rig that is symmetric across a coordinate plane gives symmetric weights to
/// symmetric vertices. `painted` is the vertices' stiffness. Throws InvalidInput as sample_mesh and Skeleton
/// do, and for a bone far outside; Cancelled.
ARAPFIELDS_EXPORT RowMatrix<float> skin_weights(const TriangleMesh& mesh, const std::vector<Bone>& bones,
                                                const SkinOptions& options, const Progress& progress = {},
                                                const VertexWeights& painted = {});
/// The same for samples of a surface.
ARAPFIELDS_EXPORT RowMatrix<float> skin_weights(const SurfaceSamples& samples, const std::vector<Bone>& bones,
                                                const SkinOptions& options, const Progress& progress = {});

}  // namespace arapfields
