// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fields/interior_distance.h"
#include "skin/piece_points.h"
#include "skin/skeleton.h"

namespace arapfields {

/// The owner bone of each node of a shape. Nodes of a surface that contains bones belong to the one of these
/// with the smallest interior distance; nodes of other surfaces belong to the owners of what they touch.
struct BoneRegions {
  /// The nodes are these samples, about `spacing` apart, and the graph's.
  /// Clips the skeleton's bones to the parts inside of the shape.
  BoneRegions(Skeleton& skeleton, const PiecePoints& surfaces, const std::vector<Index>& nodes,
              double spacing, const InteriorGraph& graph);

  /// Interior distances (n, bones) to each bone, by shortest paths in the graph; of bones that neither lie
  /// inside of the shape nor touch it a constant, larger than all.
  RowMatrix<float> distances(const InteriorGraph& graph) const;

  std::vector<Index> owner;      ///< (n) bone of each node
  std::vector<Index> own_bones;  ///< number of bones in each surface
  std::vector<bool> pulls;       ///< whether a bone lies inside of the shape or touches it
  RowMatrix<float> straight;     ///< (n, bones) Euclidean distances to the parts of the bones
};

/// Distances between bones along the skeleton's tree.
class BoneTree {
 public:
  explicit BoneTree(const Skeleton& skeleton);

  /// Whether a bone may influence points of the owner's region, at this distance from the bone.
  bool matters(Index bone, Index owner, double distance) const;

 private:
  Eigen::MatrixXi steps_;    // (bones, bones) edges of the path between two bones
  Eigen::MatrixXd between_;  // (bones, bones) total length of the bones on it
};

}  // namespace arapfields
