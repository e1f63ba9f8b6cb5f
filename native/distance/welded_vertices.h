// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A mesh's vertices with all at one place taken as one, so that its connectivity does not matter.
struct WeldedVertices {
  explicit WeldedVertices(const TriangleMesh& mesh);

  std::vector<std::int32_t> first;  ///< (n) of each vertex, the first at its place
  Points normals;                   ///< (n,3) of those; zero where no triangle is
  /// Which piece each vertex (n) belongs to, from 0: vertices that triangles join are of one.
  std::vector<Index> pieces(const TriangleMesh& mesh) const;
  /// Closed pieces of at most this size, as lists of vertices: eyes, teeth, buttons.
  std::vector<std::vector<Index>> closed_pieces(const TriangleMesh& mesh, double size) const;
};

}  // namespace arapfields
