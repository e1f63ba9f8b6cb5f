// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/pieces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "mesh/edge_passages.h"

namespace arapfields {
namespace {

/// Triangles at an edge with less than this angle between them, in radians, lie in one place.
constexpr double same_angle = 1e-6;

class UnionFind {
 public:
  explicit UnionFind(Index count) : parent_(static_cast<std::size_t>(count)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  std::int32_t find(std::int32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The smaller of the two sets' firsts stands for both.
  void join(std::int32_t a, std::int32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::int32_t> parent_;
};

/// Angles about the edge from `low` to `high` of the third corners of triangles.
template <class Passage>
std::vector<double> angles_around(const TriangleMesh& mesh, std::int32_t low, Passage from, Passage to) {
  const Vec3 start = mesh.vertices.row(low),
             axis = (Vec3(mesh.vertices.row(from->high)) - start).stableNormalized();
  const Vec3 side = axis.unitOrthogonal(), other = axis.cross(side);
  std::vector<double> angles;
  for (; from != to; ++from) {
    Vec3 away = Vec3::Zero();  // of the third corner: the farthest from the edge
    for (int k = 0; k < 3; ++k) {
      const Vec3 way = Vec3(mesh.vertices.row(mesh.triangles(from->triangle, k))) - start;
      const Vec3 across = way - way.dot(axis) * axis;
      if (across.squaredNorm() > away.squaredNorm()) away = across;
    }
    angles.push_back(std::atan2(away.dot(other), away.dot(side)));
  }
  return angles;
}

/// visit(low, p, q) for each two passages along an edge from the vertex `low` whose triangles are joined
/// there, and open(p) for each at a boundary.
template <class Visit, class Open>
void each_join(const TriangleMesh& mesh, const EdgePassages& passages, const Visit& visit, const Open& open) {
  passages.each_edge([&](std::int32_t low, auto from, auto to) {
    const auto upwards = std::count_if(from, to, [](const EdgePassage& p) { return p.upwards; });
    if (to - from == 2 || 2 * upwards != to - from) {
      for (auto p = from; p != to; ++p) {
        if (p != from) visit(low, *from, *p);
        if (to - from != 2) open(*p);
      }
      return;
    }
    // Seen along the edge, the inner side of a triangle that passes downwards lies at larger angles.
    const std::vector<double> angles = angles_around(mesh, low, from, to);
    for (auto p = from; p != to; ++p) {
      if (p->upwards) continue;
      double least = 4.0 * std::numbers::pi;
      auto next = p;
      for (auto q = from; q != to; ++q) {
        if (!q->upwards) continue;
        double turn = angles[static_cast<std::size_t>(q - from)] - angles[static_cast<std::size_t>(p - from)];
        while (turn < same_angle) turn += 2.0 * std::numbers::pi;
        if (turn < least) least = turn, next = q;
      }
      visit(low, *p, *next);
    }
  });
}

}  // namespace

std::vector<std::int32_t> joined_vertices(const TriangleMesh& mesh) {
  const EdgePassages passages(mesh.vertices, mesh.triangles);
  const auto corner_at = [&](std::int32_t triangle, std::int32_t place) {
    int k = 0;
    while (passages.first()[mesh.triangles(triangle, k)] != place) ++k;
    return mesh.triangles(triangle, k);
  };
  UnionFind joined(mesh.vertices.rows());
  each_join(
      mesh, passages,
      [&](std::int32_t low, const EdgePassage& p, const EdgePassage& q) {
        for (const std::int32_t place : {low, p.high})
          joined.join(corner_at(p.triangle, place), corner_at(q.triangle, place));
      },
      [](const EdgePassage&) {});
  std::vector<std::int32_t> result(static_cast<std::size_t>(mesh.vertices.rows()));
  for (std::int32_t v = 0; v < mesh.vertices.rows(); ++v) result[v] = joined.find(v);
  return result;
}

std::vector<std::int32_t> pieces_of(const TriangleMesh& mesh) {
  const Index count = mesh.triangles.rows();
  UnionFind joined(count);
  std::vector<bool> open(static_cast<std::size_t>(count));  // at a boundary
  const EdgePassages passages(mesh.vertices, mesh.triangles);
  each_join(
      mesh, passages,
      [&](std::int32_t, const EdgePassage& p, const EdgePassage& q) { joined.join(p.triangle, q.triangle); },
      [&](const EdgePassage& p) { open[static_cast<std::size_t>(p.triangle)] = true; });
  std::vector<bool> is_open(static_cast<std::size_t>(count));
  for (std::int32_t t = 0; t < count; ++t)
    if (open[static_cast<std::size_t>(t)]) is_open[static_cast<std::size_t>(joined.find(t))] = true;
  std::vector<std::int32_t> at_vertex(static_cast<std::size_t>(mesh.vertices.rows()), -1);
  for (std::int32_t t = 0; t < count; ++t) {
    const std::int32_t piece = joined.find(t);
    if (!is_open[static_cast<std::size_t>(piece)]) continue;
    for (int k = 0; k < 3; ++k) {
      std::int32_t& other = at_vertex[static_cast<std::size_t>(passages.first()[mesh.triangles(t, k)])];
      if (other >= 0)
        joined.join(other, t);
      else
        other = t;
    }
    is_open[static_cast<std::size_t>(joined.find(t))] = true;
  }
  std::vector<std::int32_t> number(static_cast<std::size_t>(count), -1), result;
  std::int32_t pieces = 0;
  for (std::int32_t t = 0; t < count; ++t) {
    std::int32_t& own = number[static_cast<std::size_t>(joined.find(t))];
    if (own < 0) own = pieces++;
    result.push_back(own);
  }
  return result;
}

}  // namespace arapfields
