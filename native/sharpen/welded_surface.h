// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A mesh as one surface: vertices that are at one place before and after its motion are one node, and
/// triangles without area are left out. The order of all sums follows from the mesh alone.
class WeldedSurface {
 public:
  /// The mesh must be valid, with as many moved vertices.
  WeldedSurface(const TriangleMesh& mesh, PointsIn moved);

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
  /// (m',3) normals of the triangles for these positions (k,3) of the nodes, as long as twice their areas.
  Points normals(const Points& positions) const;

  /// Corners of triangles at a node: each 3·t + k.
  template <class Visit>
  void around(Index node, Visit&& visit) const {
    for (std::int32_t at = first_[node]; at < first_[node + 1]; ++at) visit(around_[at] / 3, around_[at] % 3);
  }

  /// The rotation of each node, for these positions (k,3), that fits its triangles' edges best; as blocks
  /// (3,k,3) like the first derivatives of a jet.
  std::vector<double> rotations(const Points& positions) const;

 private:
  std::vector<std::int32_t> node_of_;
  std::vector<std::int32_t> vertex_of_;  // (k) one of each node's
  std::vector<std::int32_t> row_of_;
  Points rest_;
  Triangles corners_;
  Points weights_;
  std::vector<std::int32_t> first_;   // of each node in `around_`, and the end
  std::vector<std::int32_t> around_;  // its corners of triangles
};

/// Rotation of a node among those of WeldedSurface::rotations().
inline Mat3 rotation_at(const std::vector<double>& rotations, Index node) {
  const Index count = static_cast<Index>(rotations.size()) / 9;
  Mat3 result;
  for (int k = 0; k < 3; ++k) result.col(k) = Eigen::Map<const Vec3>(&rotations[3 * (k * count + node)]);
  return result;
}

}  // namespace arapfields
