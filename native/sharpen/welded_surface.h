// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "core/task.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A mesh as one surface: vertices that are at one place before and after its motion are one node, and
/// triangles without area are left out. Nodes and triangles near in space are near in memory, and the order
/// of all sums follows from the mesh alone.
class WeldedSurface {
 public:
  /// The mesh must be valid, with as many moved vertices.
  WeldedSurface(const TriangleMesh& mesh, PointsIn moved, const Progress& progress = {});

  Index nodes() const { return rest_.rows(); }
  /// (n) of each vertex; −1 for one without a triangle that has area.
  const std::vector<std::int32_t>& node_of() const { return node_of_; }
  /// (k,3) of the nodes.
  const Points& rest() const { return rest_; }
  /// (k,3) where the nodes are of moved vertices (n,3), those that it was made of.
  Points at_nodes(PointsIn moved) const;

  Index triangles() const { return corners_.rows(); }
  const Triangles& corners() const { return corners_; }
  /// (m') row of each triangle in the mesh.
  const std::vector<std::int32_t>& row_of() const { return row_of_; }
  /// (m',3) of the edge opposite each corner: half its cotangent, within bounds, so that no edge pushes.
  const Points& weights() const { return weights_; }
  /// Of a triangle for these positions (k,3) of the nodes, as long as twice its area.
  Vec3 normal(Index triangle, const Points& positions) const {
    const auto corner = [&](int k) -> Vec3 { return positions.row(corners_(triangle, k)); };
    return (corner(1) - corner(0)).cross(corner(2) - corner(0));
  }
  /// (m',3) of all triangles.
  void normals(const Points& positions, Points& result) const;

  /// Corners of triangles at a node: each 3·t + k.
  template <class Visit>
  void around(Index node, Visit&& visit) const {
    for (std::int32_t at = first_[node]; at < first_[node + 1]; ++at) visit(around_[at] / 3, around_[at] % 3);
  }

  /// The nodes that share an edge with node i, in ascending order: those of neighbours() from
  /// first_neighbour()[i] on.
  const std::vector<std::int32_t>& first_neighbour() const { return first_neighbour_; }
  const std::vector<std::int32_t>& neighbours() const { return neighbours_; }
  /// From a neighbour to a node at rest, times the edge's weight: Σ of those in its triangles.
  struct Edge {
    Vec3 rest;
    double weight;
  };
  /// Those of one node: each neighbour j, and the edge from it.
  template <class Visit>
  void edges(Index node, Visit&& visit) const {
    for (std::int32_t at = first_neighbour_[node]; at < first_neighbour_[node + 1]; ++at)
      visit(static_cast<Index>(neighbours_[at]), edges_[at]);
  }
  /// Of the edge to each of neighbours(): Σ of the weights in its triangles, times their factors (m').
  std::vector<double> edge_weights(const Vector& factors) const;

  /// The rotation of a node, for these positions (k,3), that fits its edges best.
  Mat3 rotation(Index node, const Points& positions) const;
  /// Of all nodes.
  void rotations(const Points& positions, std::vector<Mat3>& result) const;

 private:
  Mat3 spread(Index node, const Points& positions) const;

  std::vector<std::int32_t> node_of_;
  std::vector<std::int32_t> vertex_of_;  // (k) one of each node's
  std::vector<std::int32_t> row_of_;
  Points rest_;
  Triangles corners_;
  Points weights_;
  std::vector<std::int32_t> first_;   // of each node in `around_`, and the end
  std::vector<std::int32_t> around_;  // its corners of triangles
  std::vector<std::int32_t> first_neighbour_;
  std::vector<std::int32_t> neighbours_;
  std::vector<Edge> edges_;  // to each of them
};

}  // namespace arapfields
