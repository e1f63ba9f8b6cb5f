// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/folded_triangles.h"

#include "core/errors.h"
#include "core/parallel.h"

namespace arapfields {

void require_moved(PointsIn vertices, PointsIn moved) {
  require(moved.rows() == vertices.rows(), "moved", std::to_string(moved.rows()) + " vertices",
          "as many as the mesh has, " + std::to_string(vertices.rows()) + ", are needed");
  require(moved.allFinite(), "moved", "some coordinates are NaN or infinite", "all must be finite");
}

Points turned_normals(const WeldedSurface& surface, const std::vector<double>& rotations) {
  Points result = surface.normals(surface.rest());
  parallel_for(0, surface.triangles(), 4096, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) {
      Mat3 sum = Mat3::Zero();
      for (int k = 0; k < 3; ++k) sum += rotation_at(rotations, surface.corners()(t, k));
      result.row(t) = result.row(t) * sum.transpose();
    }
  });
  return result;
}

std::vector<Index> folded_triangles(PointsIn vertices, TrianglesIn triangles, PointsIn moved) {
  validate(vertices, triangles);
  require_moved(vertices, moved);
  const WeldedSurface surface({vertices, triangles}, moved);
  const Points positions = surface.at_nodes(moved);
  const Points expected = turned_normals(surface, surface.rotations(positions));
  const Points normals = surface.normals(positions);
  std::vector<Index> result;
  for (Index t = 0; t < surface.triangles(); ++t)
    if (expected.row(t).dot(normals.row(t)) < 0.0) result.push_back(surface.row_of()[t]);
  return result;
}

}  // namespace arapfields
