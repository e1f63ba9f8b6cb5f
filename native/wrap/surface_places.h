// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Where points (n) lie on a mesh.
struct SurfacePlaces {
  std::vector<std::int32_t> triangles;  ///< (n)
  Points shares;                        ///< (n,3) of the triangle's corners: ≥ 0, of sum one
  Vector distances;                     ///< (n) from the points, in mesh units

  /// Values of the mesh's vertices at point i, interpolated linearly: at(v) is that of vertex v.
  template <class At>
  auto interpolated(const Triangles& mesh, Index i, At&& at) const {
    const auto corner = [&](int k) { return shares(i, k) * at(mesh(triangles[i], k)); };
    return (corner(0) + corner(1) + corner(2)).eval();
  }
};

/// The nearest place of a mesh for each point (n,3), on a side that faces as the point's normal (n,3) does
/// where there is one nearby: thin parts have two sides. A normal of length 0 takes either side.
SurfacePlaces places_on(const TriangleMesh& mesh, PointsIn points, PointsIn normals,
                        const Progress& progress = {});

}  // namespace arapfields
