// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A mesh's vertices welded by position, independent of how its triangles are joined.
struct WeldedVertices {
  explicit WeldedVertices(const TriangleMesh& mesh);

  std::vector<std::int32_t> first;  ///< (n) for each vertex, the first one at its position
  Points normals;                   ///< (n,3) of the welded vertices; zero without a triangle
  /// The connected component of each vertex (n).
  std::vector<Index> pieces(const TriangleMesh& mesh) const;
  /// Closed components of at most this diagonal, as lists of vertices: eyes, teeth, buttons.
  std::vector<std::vector<Index>> closed_pieces(const TriangleMesh& mesh, double size) const;
};

}  // namespace arapfields
