// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Points (n) on a mesh, by triangles and barycentric coordinates.
struct SurfacePlaces {
  std::vector<std::int32_t> triangles;  ///< (n)
  Points shares;                        ///< (n,3) barycentric coordinates, ≥ 0
  Vector distances;                     ///< (n) from the query points, in mesh units

  /// Values of the mesh's vertices at point i, interpolated linearly: at(v) is that of vertex v.
  template <class At>
  auto interpolated(const Triangles& mesh, Index i, At&& at) const {
    const auto corner = [&](int k) { return shares(i, k) * at(mesh(triangles[i], k)); };
    return (corner(0) + corner(1) + corner(2)).eval();
  }
};

/// The point of a mesh closest to each point (n,3), preferably on a side whose normal agrees with the point's
/// normal (n,3), since thin parts have two sides. A normal of length 0 takes either side.
SurfacePlaces places_on(const TriangleMesh& mesh, PointsIn points, PointsIn normals,
                        const Progress& progress = {});

}  // namespace arapfields
