// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "distance/welded_vertices.h"
#include "shapes.h"
#include "wrap/scan_noise.h"

using namespace arapfields;

namespace {

/// Told noise beside true noise: a few thousand pairs of neighbours tell a variance to some per cent.
constexpr double told = 0.15;
/// What smoothing leaves of noise: waves longer than about eight edges.
constexpr double left = 0.4;

TriangleMesh noisy(TriangleMesh mesh, double deviation) {
  Random random(3);
  for (double& value : mesh.vertices.reshaped()) value += deviation * random.normal();
  return mesh;
}

/// A torus whose tube is a square, of few vertices: its edges are not noise.
TriangleMesh square_ring(int rings) {
  TriangleMesh mesh = shapes::torus(rings, 16);
  for (Index v = 0; v < mesh.vertices.rows(); ++v) {
    auto point = mesh.vertices.row(v);
    const double radius = point.head(2).norm(), across = radius - 1.0, up = point[2];
    const double wider = 0.4 / std::max(std::abs(across), std::abs(up));
    point.head(2) *= (1.0 + wider * across) / radius;
    point[2] = wider * up;
  }
  return mesh;
}

double root_mean_square(const Points& offsets) { return std::sqrt(offsets.rowwise().squaredNorm().mean()); }

}  // namespace

BOOST_AUTO_TEST_SUITE(scan_noise)

BOOST_AUTO_TEST_CASE(noise_of_vertices_is_told_and_smoothed) {
  const TriangleMesh clean = shapes::torus(192, 96);
  for (const double deviation : {0.003, 0.01}) {
    const TriangleMesh scan = noisy(clean, deviation);
    BOOST_TEST(vertex_noise(scan) / deviation == 1.0, boost::test_tools::tolerance(told));
    BOOST_TEST(root_mean_square(without_noise(scan) - clean.vertices) <
               left * root_mean_square(scan.vertices - clean.vertices));
  }
}

BOOST_AUTO_TEST_CASE(clean_and_coarse_meshes_stay_as_they_are) {
  for (const TriangleMesh& mesh :
       {shapes::torus(96, 48), shapes::torus(24, 16), shapes::torus(12, 8), square_ring(32), square_ring(64)})
    BOOST_TEST((without_noise(mesh).array() == mesh.vertices.array()).all());
}

BOOST_AUTO_TEST_CASE(a_sheet_of_two_triangles_back_to_back_tells_nothing) {
  TriangleMesh scan = noisy(shapes::torus(192, 96), 0.01);
  const double noise = vertex_noise(scan);
  const auto first = static_cast<std::int32_t>(scan.vertices.rows());
  scan.vertices.conservativeResize(first + 4, 3);
  scan.vertices.bottomRows(4) << 2, 0, 0, 3, 0, 0, 2, 1, 0, 3, 1, 0;  // the last is loose
  scan.triangles.conservativeResize(scan.triangles.rows() + 2, 3);
  scan.triangles.bottomRows(2) << first, first + 1, first + 2, first, first + 2, first + 1;
  BOOST_TEST(WeldedVertices(scan).normals.allFinite());
  BOOST_TEST(vertex_noise(scan) == noise, boost::test_tools::tolerance(0.05));
}

BOOST_AUTO_TEST_CASE(copies_of_a_vertex_stay_together) {
  const TriangleMesh scan = noisy(shapes::torus(96, 48), 0.01);
  TriangleMesh split{Points(3 * scan.triangles.rows(), 3), Triangles(scan.triangles.rows(), 3)};
  for (Index t = 0; t < scan.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      split.vertices.row(3 * t + k) = scan.vertices.row(scan.triangles(t, k));
      split.triangles(t, k) = static_cast<std::int32_t>(3 * t + k);
    }
  const Points smooth = without_noise(split);
  BOOST_TEST(root_mean_square(smooth - split.vertices) > 0.005);
  Points place = Points::Zero(scan.vertices.rows(), 3);
  std::vector<bool> known(place.rows(), false);
  for (Index i = 0; i < smooth.rows(); ++i) {
    const auto v = scan.triangles(i / 3, i % 3);
    if (known[v]) BOOST_TEST((smooth.row(i) == place.row(v)));
    place.row(v) = smooth.row(i);
    known[v] = true;
  }
}

BOOST_AUTO_TEST_SUITE_END()
