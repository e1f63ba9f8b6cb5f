// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "skin/bone_regions.h"

namespace arapfields {

/// Finds the owner bone of each node of a shape whose surfaces may intersect. Borrows its arguments.
class NodeOwners {
 public:
  /// The nodes, which are the graph's, are these rows of the samples, about `spacing` apart.
  NodeOwners(const PiecePoints& surfaces, const std::vector<Index>& nodes, double spacing,
             const InteriorGraph& graph);

  /// The owner (n) of each node. Clips the skeleton's bones to the parts inside of the shape.
  std::vector<Index> found(Skeleton& skeleton);
  /// (n, bones) Euclidean distances to the parts of the bones.
  const RowMatrix<float>& straight() const { return straight_; }
  /// Whether a bone lies inside of the shape or touches it.
  const std::vector<bool>& pulls() const { return pulls_; }
  /// The number of bones in each surface.
  std::vector<Index> own_bones() const;

 private:
  using Length = std::pair<float, Index>;  // length of the path to a node, and the bone at its start
  using Nodes = std::vector<std::size_t>;

  bool has_bone(std::size_t node) const { return best_[node].second >= 0; }
  Index piece(std::size_t node) const { return surfaces_.pieces[nodes_[node]]; }
  Index slot(std::size_t node) const { return slots_[piece(node)]; }
  double square(std::size_t node, std::size_t other) const {
    return (surfaces_.points.row(nodes_[node]) - surfaces_.points.row(nodes_[other])).squaredNorm();
  }
  void see(Skeleton& skeleton);
  Index surface_around(const Vec3& joint) const;
  void take_free_surfaces(const Skeleton& skeleton);
  void spread();
  void fill();
  bool lies_about(const Nodes& nodes, const Bone& bone) const;
  void touch(const Skeleton& skeleton);
  std::pair<Nodes, Nodes> nodes_with_bones() const;
  void join(const Nodes& own, const Nodes& others, const BoneTree& tree);
  bool within_another(std::size_t node) const;

  const PiecePoints& surfaces_;
  const std::vector<Index>& nodes_;
  double spacing_;
  const InteriorGraph& graph_;
  RowMatrix<float> straight_;
  std::vector<bool> pulls_;
  std::vector<Index> slots_;  // of surfaces with enough samples to enclose bones; −1: others
  Index slot_count_ = 0;
  std::vector<Length> best_;
  std::vector<std::set<Index>> own_;
};

}  // namespace arapfields
