// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/jets.h"
#include "core/task.h"
#include "core/types.h"
#include "distance/signed_distance.h"
#include "fields/inside_sight.h"
#include "fields/interior_distance.h"
#include "sampling/fine_regions.h"

namespace arapfields {

/// The side of the surface that a point lies on: the nearest node that it sees through the inside (row of the
/// nodes; those of an embedding's parts follow its own, part by part). −1: unknown; all nodes are then
/// weighted by their straight distance.
using SurfaceSide = std::int32_t;

/// What the nodes of an embedding see of each other, where parts of the shape nearly touch through the
/// outside, such as two lips or two fingers: nodes there that are near in space may be far inside the shape.
struct ARAPFIELDS_EXPORT NodeSight {
  /// Of node i: nodes that it does not see, others[k] for k from starts[i] to starts[i + 1], each with the
  /// square by which its interior distance exceeds the straight one.
  std::vector<std::int32_t> starts;
  std::vector<std::int32_t> others;
  std::vector<double> excess;
  double reach = 0.0;             ///< distance up to which nodes are listed
  Points normals = Points(0, 3);  ///< (n,3) of the nodes, unit length

  /// Prepares queries, once the lists above and the nodes (n,3), with the width of their weights, are known.
  void set_nodes(PointsIn nodes, double width);
  /// For each point (n,3) the nearest node. It is the side of most points.
  std::vector<SurfaceSide> nearest_nodes(PointsIn points) const;
  /// The nodes from which the excess at points on the side of a node is blended: that node and those that it
  /// sees near by.
  const std::vector<std::int32_t>& company(SurfaceSide node) const {
    return company_[static_cast<std::size_t>(node)];
  }
  /// Whether points that are nearest to a node may lie on the side of another.
  bool is_doubtful(SurfaceSide node) const { return doubtful_[static_cast<std::size_t>(node)]; }

  /// Whether a point on the side of one node does not see the other one.
  bool hides(SurfaceSide node, SurfaceSide other) const;

  /// Points of the surface near doubtful nodes, with their sides, for queries that know nothing but their
  /// position.
  void set_places(PointsIn places, std::vector<SurfaceSide> sides);
  const Points& places() const { return places_; }
  const std::vector<SurfaceSide>& sides() const { return sides_; }
  /// The sides (n) of points (n,3): those of the nearest places; −1 farther than `reach` from all nodes.
  std::vector<SurfaceSide> sides_near(PointsIn points) const;

 private:
  std::vector<bool> doubtful_;
  std::vector<std::vector<std::int32_t>> company_;
  std::shared_ptr<const SignedDistance> nearest_node_;
  Points places_ = Points(0, 3);
  std::vector<SurfaceSide> sides_;
  std::shared_ptr<const SignedDistance> nearest_place_;
};

struct EmbeddingPart;

/// Points (n,3) of a surface with their outward normals, and places (n,3) that lie on their sides: the points
/// themselves, or places below them inside the shape.
struct SidedPlaces {
  Points points = Points(0, 3);
  Points normals = Points(0, 3);
  Points places = Points(0, 3);
  Vector shares = Vector(0);  ///< (n) of fine parts: where it is 1, only the part's ψ matters

  /// `their_shares`: none: all 0.
  void add(PointsIn more, PointsIn their_normals, PointsIn their_places, const Vector& their_shares = {});
  SidedPlaces rows(const std::vector<Index>& chosen) const;
};

/// An embedding ψ that separates parts which are near in space but far apart inside the shape:
/// |x − y|² + |ψ(x) − ψ(y)|² approximates the squared interior distance from x to y. ψ is given by values and
/// gradients at nodes of the surface and blended between them with normalised Gaussian weights, as wide as
/// the nodes' spacing (Franke and Little's modification of Shepard's method). In the weights, a node that a
/// point's side does not see counts by its interior distance: ψ is a function on the surface, not in space,
/// and parts that touch at rest have values of their own. Fine parts have nodes of their own, whose ψ
/// takes the place of that of the whole there.
struct ARAPFIELDS_EXPORT InteriorEmbedding {
  Points nodes;                                ///< (n,3)
  Points values;                               ///< (n,3) ψ at the nodes
  RowMatrix<double> slopes;                    ///< (n,9) ∂ψ_k/∂x_i at 3 k + i
  double width = 0.0;                          ///< of the Gaussians e^{−|x|²/width²}
  std::shared_ptr<NodeSight> sight = nullptr;  ///< null: all nodes that are near see each other
  std::vector<EmbeddingPart> parts;            ///< what the nodes' spacing does not resolve

  /// Whether ψ depends on the side of a point.
  bool has_sides() const;
  /// Jets of ψ at points (n,3), of any order, each on its side (n); null: on that of the nearest known place.
  void evaluate(PointsIn points, JetView<double> out, const std::vector<SurfaceSide>* sides = nullptr) const;
  /// The sides (n) of a mesh's vertices, in mesh coordinates; `frame` is that of the nodes' cube. The ends of
  /// a short edge lie on sides that see each other, so that no such edge is torn, and vertices in one place
  /// on one side if triangles join them, so that no seam is.
  std::vector<SurfaceSide> sides_of(const TriangleMesh& mesh, const Frame& frame) const;
  /// Looks at the surface that the nodes lie on, by samples of it and by the vertices of its mesh, whose
  /// triangles face outwards: points of unknown sides take that of the nearest of the samples' places and of
  /// the vertices, and the mesh's own are kept.
  void look_at(const SidedPlaces& samples, std::shared_ptr<const TriangleMesh> mesh, const Frame& frame,
               const InsideSight& sight);

 private:
  void evaluate_own(PointsIn points, JetView<double> out, const std::vector<SurfaceSide>* sides) const;
  /// Sides among the nodes of the embedding alone; `doubtful`: is given the rows of the points near doubtful
  /// nodes.
  std::vector<SurfaceSide> own_sides_of(PointsIn points, PointsIn normals, const InsideSight& mesh,
                                        std::vector<Index>* doubtful = nullptr) const;
  std::vector<SurfaceSide> own_sides_of(const TriangleMesh& outward, const Frame& frame,
                                        const InsideSight& mesh,
                                        std::vector<Index>* doubtful = nullptr) const;
  std::vector<SurfaceSide> sides_of(const TriangleMesh& outward, const Frame& frame,
                                    const InsideSight& mesh) const;
  /// The rows of points whose nearest node is doubtful.
  std::vector<Index> near_walls(const std::vector<SurfaceSide>& nearest) const;
  /// Replaces these rows' sides, their nearest nodes, by the nearest ones that they see.
  void look(const std::vector<Index>& rows, PointsIn points, PointsIn normals, const InsideSight& mesh,
            std::vector<SurfaceSide>& sides) const;

  std::shared_ptr<const TriangleMesh> mesh_;  // that was looked at
  std::vector<SurfaceSide> mesh_sides_;
};

/// A fine part of a shape, such as a hand with its fingers.
struct EmbeddingPart {
  InteriorEmbedding embedding;     ///< its own ψ, from denser nodes; has no parts
  InteriorEmbedding share;         ///< in the first component, that of its own ψ: 1 inside, 0 from its rim on
  std::vector<SurfaceSide> sides;  ///< of its nodes, among those of the whole
  BoundingBall ball;               ///< outside of which its share is 0
};

/// Makes the sight of the surface when it is needed; null where the surface is not known.
using MakeSight = std::function<std::shared_ptr<const InsideSight>()>;

/// ψ of a surface from samples (n,3) and their outward normals, by landmark multidimensional scaling (de
/// Silva, Tenenbaum 2004) of the squared interior distances minus the squared Euclidean ones. Null if these
/// hardly differ, and for less than a hundred distinct samples. With an axis (0, 1, 2), samples are those
/// where that coordinate is positive, whose reflections are added, and ψ is symmetric: interior distances
/// from x to y and from S x to S y are equal. `may_join`: whether an edge of the graph may join two samples;
/// none: always; without an axis only. `make_sight`: called where parts nearly touch.
ARAPFIELDS_EXPORT std::shared_ptr<InteriorEmbedding> interior_embedding(PointsIn samples, PointsIn normals,
                                                                        int axis = -1,
                                                                        const MayJoin& may_join = {},
                                                                        const MakeSight& make_sight = {});

/// Gives an embedding of samples a part for each fine region of their surface. With an axis, the regions lie
/// on the side where that coordinate is positive, and their reflections are parts as well; −1: none. Throws
/// Cancelled.
void add_parts(InteriorEmbedding& whole, const std::vector<FineRegion>& regions, const MakeSight& make_sight,
               int axis, const Progress& progress);

}  // namespace arapfields
