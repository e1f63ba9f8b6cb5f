// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/folded_triangles.h"

#include <algorithm>

#include "core/errors.h"
#include "core/parallel.h"

namespace arapfields {

void require_moved(PointsIn vertices, PointsIn moved) {
  require(moved.rows() == vertices.rows(), "moved", std::to_string(moved.rows()) + " vertices",
          "as many as the mesh has, " + std::to_string(vertices.rows()) + ", are needed");
  require(moved.allFinite(), "moved", "some coordinates are NaN or infinite", "all must be finite");
}

namespace {

/// `rotation_of`: that of a node.
template <class RotationOf>
bool faces_away(const WeldedSurface& surface, Index triangle, const Points& positions,
                const RotationOf& rotation_of) {
  Mat3 sum = Mat3::Zero();
  for (int k = 0; k < 3; ++k) sum += rotation_of(surface.corners()(triangle, k));
  return (sum * surface.normal(triangle, surface.rest())).dot(surface.normal(triangle, positions)) < 0.0;
}

}  // namespace

bool is_folded(const WeldedSurface& surface, Index triangle, const Points& positions,
               const std::vector<Mat3>& rotations) {
  return faces_away(surface, triangle, positions, [&](Index i) -> const Mat3& { return rotations[i]; });
}

bool is_folded(const WeldedSurface& surface, Index triangle, const Points& positions) {
  return faces_away(surface, triangle, positions, [&](Index i) { return surface.rotation(i, positions); });
}

std::vector<char> all_folded(const WeldedSurface& surface, const Points& positions,
                             const std::vector<Mat3>& rotations) {
  std::vector<char> result(surface.triangles());
  parallel_for(0, surface.triangles(), 4096, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) result[t] = is_folded(surface, t, positions, rotations);
  });
  return result;
}

std::vector<Index> folded_triangles(PointsIn vertices, TrianglesIn triangles, PointsIn moved) {
  validate(vertices, triangles);
  require_moved(vertices, moved);
  const WeldedSurface surface({vertices, triangles}, moved);
  const Points positions = surface.at_nodes(moved);
  std::vector<Mat3> rotations;
  surface.rotations(positions, rotations);
  const std::vector<char> folded = all_folded(surface, positions, rotations);
  std::vector<Index> result;
  for (Index t = 0; t < surface.triangles(); ++t)
    if (folded[t]) result.push_back(surface.row_of()[t]);
  std::sort(result.begin(), result.end());
  return result;
}

}  // namespace arapfields
