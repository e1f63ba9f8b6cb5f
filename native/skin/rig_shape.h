// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "distance/welded_vertices.h"
#include "energies/handles.h"
#include "mesh/sample_mesh.h"
#include "options/skin.h"
#include "sampling/oriented_points.h"
#include "skin/bone_regions.h"
#include "skin/piece_points.h"

namespace arapfields {

/// A shape and the skeleton in it: nodes spread over the surface, at which weights and correctives are
/// fitted. Mesh coordinates.
struct RigShape {
  /// Throws InvalidInput that names a bone far outside of the shape.
  /// `pieces` (n; empty: all 0) tells which of several surfaces each sample lies on.
  RigShape(const SurfaceSamples& surface, const std::vector<Bone>& bones, const Progress& progress,
           std::vector<Index> pieces = {});

  Index size() const { return nodes.points.rows(); }
  /// The nearest node of the same surface and side of each of some points, and the nearest sample.
  std::vector<Index> nearest_nodes(const PiecePoints& points) const {
    return nearest_on_own(points, nodes, spacing, enough_nodes());
  }
  std::vector<Index> nearest_samples(const PiecePoints& points) const {
    return nearest_on_own(points, surface, 0.0, enough_nodes());
  }
  /// Whether surfaces of parts that go different ways touch or cut each other.
  bool cuts_itself() const { return cuts_itself_; }
  /// Whether a bone may move what belongs to another, at this distance from it. All may where no parts touch.
  bool matters(Index bone, Index owner, double distance) const {
    return !cuts_itself_ || tree.matters(bone, owner, distance);
  }
  /// Whether a bone may move a node, at this distance from it. Where parts touch, those of its surface alone.
  bool may_move(Index bone, Index node, double distance) const {
    return !cuts_itself_ || (tree.matters(bone, owners[node], distance) && moves_[nodes.pieces[node]][bone]);
  }
  /// Whether several bones lie in a surface.
  bool bends(Index piece) const {
    return own_bones_.size() > 1 && piece < static_cast<Index>(own_bones_.size()) && own_bones_[piece] > 1;
  }
  bool may_join(Index node, Index other) const { return matters(owners[node], owners[other], 0.0); }
  /// Nodes of a surface within a distance of a place, in order.
  std::vector<Index> nodes_within(const Vec3& place, double distance, Index piece) const;
  /// The bone that a point near this node goes with wholly; −1 where none is.
  Index holder(const Vec3& point, Index node) const;

  SurfaceSamples samples;
  Skeleton skeleton;
  BoneTree tree;
  Skeleton::Symmetry symmetry;
  std::vector<int> sides;  ///< of each bone: −1 and 1 off the plane of symmetry, 0 elsewhere
  std::vector<Handle> handles;
  PiecePoints surface;  ///< the samples
  PiecePoints nodes;    ///< (n) of these
  double extent;        ///< size of the shape
  double spacing;       ///< of the nodes
  /// Neighbours of each node through the inside, with weights of sum one.
  std::vector<std::vector<std::pair<Index, double>>> neighbours;
  RowMatrix<float> bone_distances;  ///< (n, bones) through the inside
  std::vector<Index> owners;        ///< (n) the bone that each node belongs to
  Vector trust;                     ///< (n) in the field's shape, less where others' surfaces are near
  Vector key_trust;                 ///< (n) the same, 0 on surfaces much of which is doubtful
  std::vector<Index> sample_nodes;  ///< the node nearest to each sample

 private:
  /// How many nodes a surface needs that needs no other's. Where parts touch, each stands alone.
  Index enough_nodes() const { return cuts_itself_ ? 1 : 30; }
  bool stands_alone(Index piece) const {
    return piece < static_cast<Index>(node_counts_.size()) && node_counts_[piece] >= enough_nodes();
  }
  void set_movers();
  void set_trust();
  void set_handles();

  OrientedPoints places_;
  std::vector<Index> node_counts_;        // of each surface
  std::vector<Index> own_bones_;          // of each surface: how many lie in it
  std::vector<std::vector<bool>> moves_;  // of each surface: the bones that own much of it
  bool cuts_itself_ = false;
};

/// The same of a mesh, of whose samples those joined by triangles lie on one surface.
RigShape rig_shape(const TriangleMesh& mesh, const WeldedVertices& welded, const VertexWeights& painted,
                   const std::vector<Bone>& bones, const SkinOptions& options, const Progress& progress);

/// Each bone as a handle at rest: it holds the samples about its middle, up to its end where no bone follows.
/// Mesh coordinates. Throws InvalidInput as Skeleton does, and where a bone lies far outside of the shape.
ARAPFIELDS_EXPORT std::vector<Handle> bone_handles(const SurfaceSamples& samples,
                                                   const std::vector<Bone>& bones);

}  // namespace arapfields
