// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fields/interior_distance.h"
#include "skin/piece_points.h"
#include "skin/skeleton.h"

namespace arapfields {

/// Which bone each node of a shape belongs to. A surface with bones in it belongs to these, each node to the
/// one that is nearest through the inside; others belong to what they touch.
struct BoneRegions {
  /// The nodes are these samples, about `spacing` apart, and the graph's.
  BoneRegions(const Skeleton& skeleton, const PiecePoints& surfaces, const std::vector<Index>& nodes,
              double spacing, const InteriorGraph& graph);

  /// Lengths (n, bones) of the shortest ways to each bone.
  RowMatrix<float> distances(const InteriorGraph& graph) const;

  std::vector<Index> owner;      ///< (n) the bone
  std::vector<Index> own_bones;  ///< of each surface: how many lie in it
  RowMatrix<float> straight;     ///< (n, bones) straight distances
};

/// How far bones are from each other along the skeleton.
class BoneTree {
 public:
  explicit BoneTree(const Skeleton& skeleton);

  /// Whether a bone can matter to what belongs to another, at this distance from it.
  bool matters(Index bone, Index owner, double distance) const;

 private:
  Eigen::MatrixXi steps_;    // (bones, bones) from one to the other
  Eigen::MatrixXd between_;  // (bones, bones) length of the bones between
};

}  // namespace arapfields
