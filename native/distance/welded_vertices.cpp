// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/welded_vertices.h"

#include <Eigen/Geometry>
#include <map>

#include "core/types.h"
#include "mesh/is_closed.h"

namespace arapfields {

WeldedVertices::WeldedVertices(const TriangleMesh& mesh)
    : first(first_at_position(mesh.vertices)), normals(Points::Zero(mesh.vertices.rows(), 3)) {
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices.row(mesh.triangles(t, k))); };
    const Vec3 area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    for (int k = 0; k < 3; ++k) normals.row(first[mesh.triangles(t, k)]) += area;
  }
  normals = unit_rows(normals);
}

std::vector<Index> WeldedVertices::pieces(const TriangleMesh& mesh) const {
  std::vector<std::int32_t> root = first;
  const auto find = [&](std::int32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) root[find(mesh.triangles(t, k))] = find(mesh.triangles(t, (k + 1) % 3));
  std::vector<Index> number(first.size(), -1), result;
  Index count = 0;
  for (std::size_t v = 0; v < first.size(); ++v) {
    Index& piece = number[find(static_cast<std::int32_t>(v))];
    if (piece < 0) piece = count++;
    result.push_back(piece);
  }
  return result;
}

std::vector<std::vector<Index>> WeldedVertices::closed_pieces(const TriangleMesh& mesh, double size) const {
  const std::vector<Index> piece_of = pieces(mesh);
  std::map<std::pair<std::int32_t, std::int32_t>, int> open;  // directed edges, and how often they occur
  const auto edge_of = [&](Index t, int k) {
    return std::pair(first[mesh.triangles(t, k)], first[mesh.triangles(t, (k + 1) % 3)]);
  };
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = edge_of(t, k);
      if (a == b) continue;
      open[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  std::map<Index, std::vector<Index>> all;
  for (std::size_t v = 0; v < first.size(); ++v) all[piece_of[v]].push_back(static_cast<Index>(v));
  for (const auto& [edge, balance] : open)
    if (balance != 0) all.erase(piece_of[edge.first]);
  std::vector<std::vector<Index>> result;
  for (auto& [piece, members] : all) {
    Eigen::AlignedBox3d box;
    for (const Index v : members) box.extend(Vec3(mesh.vertices.row(v)));
    if (box.diagonal().norm() <= size && normals.row(members.front()).squaredNorm() > 0.0)
      result.push_back(std::move(members));
  }
  return result;
}

}  // namespace arapfields
