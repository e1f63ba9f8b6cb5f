// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/triangle_mesh.h"

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/types.h"

namespace arapfields {

void validate(PointsIn vertices, TrianglesIn triangles) {
  require(vertices.rows() > 0, "vertices", "there are none", "a mesh needs at least three");
  require(vertices.rows() <= INT32_MAX, "vertices", std::to_string(vertices.rows()) + " of them",
          "32-bit indices reach " + std::to_string(INT32_MAX));
  require(triangles.rows() > 0, "triangles", "there are none", "a mesh needs at least one");
  require(triangles.rows() <= INT32_MAX, "triangles", std::to_string(triangles.rows()) + " of them",
          "at most " + std::to_string(INT32_MAX) + " are supported");
  // Texts are made only where something is wrong: there are millions of vertices to look at.
  for (Index i = 0; i < vertices.rows(); ++i)
    if (!vertices.row(i).allFinite())
      throw InvalidInput("vertices", "vertex " + std::to_string(i) + " is NaN or infinite",
                         "all coordinates must be finite");
  const auto count = static_cast<std::int32_t>(vertices.rows());
  for (Index t = 0; t < triangles.rows(); ++t)
    for (int corner = 0; corner < 3; ++corner) {
      const std::int32_t index = triangles(t, corner);
      if (index < 0 || index >= count)
        throw InvalidInput("triangles",
                           "triangle " + std::to_string(t) + " refers to vertex " + std::to_string(index),
                           "indices 0 to " + std::to_string(count - 1) + " exist");
    }
}

Points used_vertices(PointsIn vertices, TrianglesIn triangles) {
  std::vector<char> used(vertices.rows(), 0);
  for (Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) used[triangles(t, k)] = 1;
  Points result(vertices.rows(), 3);
  Index count = 0;
  for (Index i = 0; i < vertices.rows(); ++i)
    if (used[i]) result.row(count++) = vertices.row(i);
  result.conservativeResize(count, 3);
  return result;
}

Points vertex_normals(const TriangleMesh& mesh) {
  Points normals = Points::Zero(mesh.vertices.rows(), 3);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices.row(mesh.triangles(t, k))); };
    const Vec3 area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    for (int k = 0; k < 3; ++k) normals.row(mesh.triangles(t, k)) += area;
  }
  return unit_rows(normals);
}

}  // namespace arapfields
