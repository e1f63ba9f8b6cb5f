// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/triangle_mesh.h"
#include "skin/rig_shape.h"

namespace arapfields {

/// A mesh's vertices with all at one place taken as one, so that its connectivity does not matter.
struct WeldedVertices {
  explicit WeldedVertices(const TriangleMesh& mesh);

  std::vector<std::int32_t> first;  ///< (n) of each vertex, the first at its place
  Points normals;                   ///< (n,3) of those; zero where no triangle is
  /// Closed pieces of at most this size, as lists of vertices: eyes, teeth, buttons.
  std::vector<std::vector<Index>> closed_pieces(const TriangleMesh& mesh, double size) const;
};

/// Values at a rig's nodes taken to other points of the surface: linear where the nodes are, from those of
/// the same side.
class VertexBlend {
 public:
  VertexBlend(const RigShape& rig, PointsIn points, PointsIn normals);

  /// Values (nodes, k) at the points (n, k).
  RowMatrix<float> operator()(const RowMatrix<float>& values) const;

 private:
  struct Entry {
    Index node;
    float weight;
  };
  std::vector<std::vector<Entry>> entries_;
};

}  // namespace arapfields
