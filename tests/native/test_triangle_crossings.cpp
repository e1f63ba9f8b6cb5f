// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <boost/test/unit_test.hpp>
#include <set>
#include <utility>

#include "core/parallel.h"
#include "distance/triangle_crossings.h"
#include "mesh/is_closed.h"
#include "shapes.h"

using namespace arapfields;

namespace {

using Pairs = std::set<std::pair<std::int32_t, std::int32_t>>;

Vec3 corner(const TriangleMesh& mesh, Index t, int k) {
  return mesh.vertices.row(mesh.triangles(t, k)).transpose();
}

/// Whether the segment meets the triangle, by Möller and Trumbore (1997).
bool meets(const Vec3& from, const Vec3& to, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 way = to - from, first = b - a, second = c - a, h = way.cross(second);
  const double determinant = first.dot(h);
  if (determinant == 0.0) return false;
  const Vec3 s = (from - a) / determinant, q = s.cross(first);
  const double u = s.dot(h), v = way.dot(q), t = second.dot(q);
  return u > 0.0 && v > 0.0 && u + v < 1.0 && t > 0.0 && t < 1.0;
}

Pairs by_all_pairs(const TriangleMesh& mesh, const std::vector<std::int32_t>& same) {
  Pairs pairs;
  for (std::int32_t i = 0; i < mesh.triangles.rows(); ++i)
    for (std::int32_t j = i + 1; j < mesh.triangles.rows(); ++j) {
      bool joined = false, met = false;
      for (int k = 0; k < 9; ++k)
        joined = joined || same[mesh.triangles(i, k / 3)] == same[mesh.triangles(j, k % 3)];
      for (int k = 0; k < 3; ++k)
        met = met ||
              meets(corner(mesh, i, k), corner(mesh, i, (k + 1) % 3), corner(mesh, j, 0), corner(mesh, j, 1),
                    corner(mesh, j, 2)) ||
              meets(corner(mesh, j, k), corner(mesh, j, (k + 1) % 3), corner(mesh, i, 0), corner(mesh, i, 1),
                    corner(mesh, i, 2));
      if (met && !joined) pairs.insert({i, j});
    }
  return pairs;
}

Pairs found(const TriangleMesh& mesh) {
  Pairs pairs;
  for (const TriangleCrossing& each :
       arapfields::triangle_crossings(mesh.vertices, mesh.triangles, first_at_position(mesh.vertices))) {
    pairs.insert(std::minmax(each.edge_of, each.through));
    Vec3 on_edge = Vec3::Zero(), within = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      on_edge += each.edge_at[k] * corner(mesh, each.edge_of, k);
      within += each.through_at[k] * corner(mesh, each.through, k);
    }
    BOOST_TEST((on_edge - within).norm() < 1e-9);
    BOOST_TEST(each.edge_at.minCoeff() == 0.0);
  }
  return pairs;
}

TriangleMesh together(const TriangleMesh& one, const TriangleMesh& other) {
  TriangleMesh mesh{Points(one.vertices.rows() + other.vertices.rows(), 3),
                    Triangles(one.triangles.rows() + other.triangles.rows(), 3)};
  mesh.vertices << one.vertices, other.vertices;
  mesh.triangles << one.triangles, other.triangles.array() + static_cast<int>(one.vertices.rows());
  return mesh;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(triangle_crossings)

BOOST_AUTO_TEST_CASE(crossings_are_those_of_all_pairs) {
  const TriangleMesh ring = shapes::torus(20, 10, 0.6, 0.2);
  TriangleMesh turned = ring;
  turned.vertices = ring.vertices * Eigen::AngleAxisd(1.2, Vec3(0.3, 1.0, 0.2).normalized()).matrix();
  turned.vertices.col(0).array() += 0.55;
  for (const TriangleMesh& mesh : {ring, together(ring, turned), shapes::soup(150, 3)})
    BOOST_TEST((found(mesh) == by_all_pairs(mesh, first_at_position(mesh.vertices))));
  BOOST_TEST(found(ring).empty());
  BOOST_TEST(found(together(ring, turned)).size() > 20u);
}

BOOST_AUTO_TEST_CASE(crossings_do_not_depend_on_threads) {
  const TriangleMesh mesh = shapes::soup(600, 5);
  const std::vector<std::int32_t> same = first_at_position(mesh.vertices);
  const auto with = [&](int threads) {
    const ThreadScope scope(threads);
    std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
    for (const TriangleCrossing& each : arapfields::triangle_crossings(mesh.vertices, mesh.triangles, same))
      pairs.emplace_back(each.edge_of, each.through);
    return pairs;
  };
  BOOST_TEST((with(1) == with(3)));
}

BOOST_AUTO_TEST_SUITE_END()
