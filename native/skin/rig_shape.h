// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "core/task.h"
#include "distance/welded_vertices.h"
#include "energies/handles.h"
#include "fields/inside_sight.h"
#include "mesh/sample_mesh.h"
#include "options/skin.h"
#include "sampling/oriented_points.h"
#include "skin/bone_regions.h"

namespace arapfields {

/// A shape and its skeleton: nodes, spread over the surface, at which weights are fitted, with interior
/// distances to the bones. Mesh coordinates.
struct RigShape {
  /// Throws InvalidInput that names a bone far outside of the shape.
  /// `pieces` (n; empty: all 0) are the indices of the samples' surfaces.
  RigShape(const SurfaceSamples& surface, const std::vector<Bone>& bones, const Progress& progress,
           std::vector<Index> pieces = {});

  Index size() const { return nodes.points.rows(); }
  /// For each point the nearest node of the same surface and side, which it sees through the inside where
  /// parts nearly touch; or the nearest sample.
  std::vector<Index> nearest_nodes(const PiecePoints& points) const;
  std::vector<Index> nearest_samples(const PiecePoints& points) const {
    return nearest_on_own(points, surface, 0.0, enough_nodes());
  }
  /// Whether surfaces owned by unrelated bones touch or intersect.
  bool cuts_itself() const { return cuts_itself_; }
  /// Whether a bone may influence the owner's region at this distance; always true without such parts.
  bool matters(Index bone, Index owner, double distance) const {
    return !cuts_itself_ || tree.matters(bone, owner, distance);
  }
  /// Whether a bone may move a node at this distance. If such parts touch, only bones that own much of the
  /// node's surface may.
  bool may_move(Index bone, Index node, double distance) const {
    return !cuts_itself_ || (tree.matters(bone, owners[node], distance) && moves_[nodes.pieces[node]][bone]);
  }
  /// Whether a surface contains several bones.
  bool bends(Index piece) const {
    return own_bones_.size() > 1 && piece < static_cast<Index>(own_bones_.size()) && own_bones_[piece] > 1;
  }
  bool may_join(Index node, Index other) const {
    return matters(owners[node], owners[other], 0.0) && !are_apart(node, other);
  }
  /// Whether two nodes that are near each other lie on two sides of a gap, far from each other inside.
  bool are_apart(Index node, Index other) const;
  /// Nodes of a surface within a distance of a place, ascending.
  std::vector<Index> nodes_within(const Vec3& place, double distance, Index piece) const;
  /// The bone with which a point near this node moves rigidly; −1: none.
  Index holder(const Vec3& point, Index node) const;

  SurfaceSamples samples;
  Skeleton skeleton;
  BoneTree tree;
  Skeleton::Symmetry symmetry;
  std::vector<int> sides;       ///< side of each bone: −1 or 1 off the symmetry plane, else 0
  std::vector<bool> pulls;      ///< whether each bone lies inside of the shape or touches it
  std::vector<Handle> handles;  ///< of all bones
  PiecePoints surface;          ///< the samples
  PiecePoints nodes;            ///< (n) the subset of nodes
  double extent;                ///< size of the shape
  double spacing;               ///< mean spacing of the nodes
  /// Neighbours of each node in the interior graph, with weights of sum one.
  std::vector<std::vector<std::pair<Index, double>>> neighbours;
  RowMatrix<float> bone_distances;  ///< (n, bones) interior distances
  std::vector<Index> owners;        ///< (n) owner bone of each node
  Vector trust;                     ///< (n) weight of the field's poses, low near surfaces of unrelated bones
  Vector key_trust;                 ///< (n) the same for correctives, 0 on surfaces where much of it is low
  std::vector<Index> sample_nodes;  ///< the node nearest to each sample

 private:
  /// Number of nodes from which a surface uses its own nodes only; 1 if unrelated parts touch.
  Index enough_nodes() const { return cuts_itself_ ? 1 : 30; }
  bool stands_alone(Index piece) const {
    return piece < static_cast<Index>(node_counts_.size()) && node_counts_[piece] >= enough_nodes();
  }
  void find_gaps(const std::vector<Index>& chosen, const Progress& progress);
  void set_movers();
  void set_trust();
  void set_handles();

  OrientedPoints places_;
  std::shared_ptr<const InsideSight> sight_;  // null where the mesh is not known, or no parts nearly touch
  std::vector<std::vector<Index>> apart_;  // (n) nodes from which each is apart, ascending; empty as sight_
  std::vector<Index> node_counts_;         // number of nodes of each surface
  std::vector<Index> own_bones_;           // number of bones in each surface
  std::vector<std::vector<bool>> moves_;   // (surfaces, bones) whether a bone owns much of a surface
  bool cuts_itself_ = false;
};

/// The rig shape of a mesh, whose surfaces are its connected components.
RigShape rig_shape(const TriangleMesh& mesh, const WeldedVertices& welded, const VertexWeights& painted,
                   const std::vector<Bone>& bones, const SkinOptions& options, const Progress& progress);

/// Each deforming bone as a handle at rest, which holds the samples around its middle, or up to its tail if
/// it is a leaf. Mesh coordinates. Throws InvalidInput as Skeleton does, and where a bone lies far outside of
/// the shape.
ARAPFIELDS_EXPORT std::vector<Handle> bone_handles(const SurfaceSamples& samples,
                                                   const std::vector<Bone>& bones);

}  // namespace arapfields
