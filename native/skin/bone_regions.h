// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "energies/handles.h"
#include "fields/interior_distance.h"
#include "mesh/surface_samples.h"
#include "skin/skeleton.h"

namespace arapfields {

/// Which bone each of some points (n,3) of a surface lies at. A bone on the outer side of the surface counts
/// as farther than one inside.
struct BoneRegions {
  BoneRegions(const Skeleton& skeleton, PointsIn points, PointsIn normals);

  RowMatrix<float> distances;  ///< (n, bones) straight, in units of the points
  std::vector<Index> owner;    ///< (n) the bone
};

/// Each bone as a handle at rest: it holds the samples about its middle, up to its end where no bone follows.
/// Mesh coordinates. Throws InvalidInput that names a bone far outside of the shape.
std::vector<Handle> bone_handles(const SurfaceSamples& samples, const Skeleton& skeleton);
ARAPFIELDS_EXPORT std::vector<Handle> bone_handles(const SurfaceSamples& samples,
                                                   const std::vector<Bone>& bones);

/// Lengths (n, bones) of the shortest ways from the graph's nodes (n,3) through the inside to each bone.
RowMatrix<float> interior_bone_distances(const InteriorGraph& graph, const BoneRegions& regions);

}  // namespace arapfields
