// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "mesh/surface_samples.h"
#include "skin/bone_regions.h"

namespace arapfields {

/// A shape and the skeleton in it: nodes spread over the surface, at which weights and correctives are
/// fitted. Mesh coordinates.
struct RigShape {
  RigShape(const SurfaceSamples& surface, const std::vector<Bone>& bones, const Progress& progress);

  Index size() const { return nodes.rows(); }

  SurfaceSamples samples;
  Skeleton skeleton;
  Skeleton::Symmetry symmetry;
  std::vector<int> sides;  ///< of each bone: −1 and 1 off the plane of symmetry, 0 elsewhere
  std::vector<Handle> handles;
  Points nodes;    ///< (n,3)
  Points normals;  ///< (n,3) of the nodes, outwards
  double extent;   ///< size of the shape
  double spacing;  ///< of the nodes
  /// Neighbours of each node through the inside, with weights of sum one.
  std::vector<std::vector<std::pair<Index, double>>> neighbours;
  RowMatrix<float> bone_distances;  ///< (n, bones) through the inside
};

}  // namespace arapfields
