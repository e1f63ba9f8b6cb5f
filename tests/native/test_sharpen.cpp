// SPDX-License-Identifier: GPL-3.0-or-later
// Folds that sharpen() opens, seen by the sanitizers; what it makes of styles: tests/python/test_sharpen.py.
#include <algorithm>
#include <boost/test/unit_test.hpp>

#include "core/random.h"
#include "energies/styles.h"
#include "shapes.h"
#include "sharpen/folded_triangles.h"
#include "sharpen/sharpen.h"

using namespace arapfields;

namespace {

const Style cube = preferred_normals("cube");

Points squeezed(const TriangleMesh& mesh) {
  Points moved = mesh.vertices;
  moved.col(0) *= 1.3;
  moved.col(1) *= 0.8;
  return moved;
}

/// The mesh with a tiny triangle inside every seventh of its triangles, joined to its corners.
TriangleMesh with_tiny_triangles(const TriangleMesh& mesh, double size) {
  std::vector<Eigen::RowVector3d> vertices;
  std::vector<Eigen::RowVector3i> triangles;
  for (const auto& row : mesh.vertices.rowwise()) vertices.emplace_back(row);
  Random random(1);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const Eigen::RowVector3i outer = mesh.triangles.row(t);
    if (t % 7 != 0) {
      triangles.push_back(outer);
      continue;
    }
    const auto first = static_cast<std::int32_t>(vertices.size());
    const Eigen::RowVector3d middle = (vertices[outer[0]] + vertices[outer[1]] + vertices[outer[2]]) / 3.0;
    for (int k = 0; k < 3; ++k)
      vertices.emplace_back(middle + size * (0.5 + random.uniform()) * (vertices[outer[k]] - middle));
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      triangles.emplace_back(outer[k], outer[next], first + next);
      triangles.emplace_back(outer[k], first + next, first + k);
    }
    triangles.emplace_back(first, first + 1, first + 2);
  }
  TriangleMesh result{Points(vertices.size(), 3), Triangles(triangles.size(), 3)};
  for (std::size_t i = 0; i < vertices.size(); ++i) result.vertices.row(static_cast<Index>(i)) = vertices[i];
  for (std::size_t t = 0; t < triangles.size(); ++t)
    result.triangles.row(static_cast<Index>(t)) = triangles[t];
  return result;
}

/// Whether no triangle is folded but those that are before; and how far the vertices went on average.
double moved_without_a_fold(const TriangleMesh& mesh, const Points& moved, const Contact& contact = {}) {
  const Points result =
      arapfields::sharpen(mesh.vertices, mesh.triangles, moved, cube, {}, {}, {}, {}, contact);
  const std::vector<Index> before = folded_triangles(mesh.vertices, mesh.triangles, moved),
                           after = folded_triangles(mesh.vertices, mesh.triangles, result);
  BOOST_TEST(std::includes(before.begin(), before.end(), after.begin(), after.end()));
  return (result - moved).rowwise().norm().mean();
}

}  // namespace

BOOST_AUTO_TEST_SUITE(sharpen)

BOOST_AUTO_TEST_CASE(single_folds_of_before_are_opened) {
  const TriangleMesh mesh = shapes::torus(40, 24);
  Points moved = squeezed(mesh);
  for (Index t = 5; t < mesh.triangles.rows(); t += 301) {
    const std::int32_t from = mesh.triangles(t, 0), to = mesh.triangles(t, 1);
    moved.row(from) += 1.5 * (moved.row(to) - moved.row(from));
  }
  BOOST_TEST(folded_triangles(mesh.vertices, mesh.triangles, moved).size() > 0);
  const Points result = arapfields::sharpen(mesh.vertices, mesh.triangles, moved, cube);
  BOOST_TEST(folded_triangles(mesh.vertices, mesh.triangles, result).empty());
}

BOOST_AUTO_TEST_CASE(tiny_triangles_stay_open_and_the_finish_is_kept) {
  const TriangleMesh mesh = shapes::torus(40, 24);
  const double without = moved_without_a_fold(mesh, squeezed(mesh));
  for (const double size : {1e-2, 1e-4, 1e-6}) {
    const TriangleMesh tiny = with_tiny_triangles(mesh, size);
    BOOST_TEST(moved_without_a_fold(tiny, squeezed(tiny)) > 0.5 * without);
  }
}

BOOST_AUTO_TEST_CASE(patches_that_were_pressed_to_a_point_fold_no_more) {
  const TriangleMesh mesh = shapes::torus(60, 36);
  for (const double shrink : {0.0, 1e-3, 1e-2}) {
    Points moved = mesh.vertices;
    Random random(2);
    const Eigen::RowVector3d middle(1.4, 0.0, 0.0);
    for (Index v = 0; v < moved.rows(); ++v)
      if ((moved.row(v) - middle).norm() < 0.3)
        moved.row(v) = middle + shrink * (moved.row(v) - middle) +
                       1e-5 * Eigen::RowVector3d(random.normal(), random.normal(), random.normal());
    BOOST_TEST(moved_without_a_fold(mesh, moved) > 0.0);
  }
}

BOOST_AUTO_TEST_CASE(folds_are_opened_above_the_ground) {
  const TriangleMesh mesh = shapes::torus(40, 24);
  Contact contact;
  contact.ground = -0.38;
  BOOST_TEST(moved_without_a_fold(mesh, squeezed(mesh), contact) > 0.0);
}

BOOST_AUTO_TEST_SUITE_END()
