// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <boost/test/unit_test.hpp>
#include <map>

#include "extraction/extract_surface.h"
#include "extraction/thin_parts.h"
#include "implicit_shapes.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(thin_parts)

namespace {

/// Two balls, and a thin slanting rod between them: a distance but where they meet.
shapes::Analytic dumbbell(double radius, const Vec3& half_way = Vec3(0.52, 0.31, 0.23)) {
  shapes::Analytic shape([=](const Vec3& x) {
    const double along = std::clamp(x.dot(half_way) / half_way.squaredNorm(), -1.0, 1.0);
    const double rod = (x - along * half_way).norm() - radius;
    return std::min(
        {rod, shapes::sphere_distance(x, half_way, 0.22), shapes::sphere_distance(x, -half_way, 0.22)});
  });
  shape.bound = 1.0;
  return shape;
}

void check_closed(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, std::pair<int, int>> edges;
  std::map<int, std::map<int, int>> next;  // around each vertex
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) {
      const int a = mesh.triangles(t, c), b = mesh.triangles(t, (c + 1) % 3);
      auto& uses = edges[{std::min(a, b), std::max(a, b)}];
      ++(a < b ? uses.first : uses.second);
      next[a][b] = mesh.triangles(t, (c + 2) % 3);
    }
  Index bad = 0;
  for (const auto& [edge, uses] : edges) bad += uses.first != 1 || uses.second != 1;
  BOOST_TEST(bad == 0);
  Index pinched = 0;  // vertices whose triangles are not one fan
  for (const auto& [vertex, steps] : next) {
    std::size_t length = 0;
    int at = steps.begin()->first;
    do {
      at = steps.at(at);
      ++length;
    } while (at != steps.begin()->first && length <= steps.size());
    pinched += length != steps.size();
  }
  BOOST_TEST(pinched == 0);
}

}  // namespace

BOOST_AUTO_TEST_CASE(what_comes_apart_is_named_and_a_resolution_that_holds_it) {
  for (const auto known : {true, false}) {
    auto shape = dumbbell(0.012);
    if (!known) shape.bound.reset();
    ExtractionReport report;
    const TriangleMesh mesh = extract_surface(shape, 64, {}, &report);
    BOOST_TEST(report.pieces == piece_count(mesh));
    BOOST_TEST(report.pieces > 1);
    BOOST_TEST(report.thin_cells > 0);
    BOOST_REQUIRE(report.notes.size() == 1u);
    BOOST_TEST(report.notes[0].find(std::to_string(report.pieces) + " pieces") != std::string::npos);
    BOOST_TEST(report.notes[0].find(std::to_string(report.holding_resolution)) != std::string::npos);
    ExtractionReport finer;
    extract_surface(shape, report.holding_resolution, {}, &finer);
    BOOST_TEST(finer.pieces == 1);
    BOOST_TEST(finer.notes.empty());
  }
}

BOOST_AUTO_TEST_CASE(refined_thin_parts_hold_together_without_cracks) {
  const Vec3 ways[] = {Vec3(0.52, 0.31, 0.23), Vec3(0.6, 0.02, 0.01), Vec3(0.4, 0.4, 0.4),
                       Vec3(-0.1, 0.5, 0.31)};
  for (const Vec3& way : ways)
    for (const double radius : {0.03, 0.014, 0.009})
      for (const int n : {24, 47}) {
        const auto shape = dumbbell(radius, way);
        ExtractionReport report;
        const TriangleMesh mesh = extract_surface(shape, {.resolution = n, .refine_thin = true}, {}, &report);
        check_closed(mesh);
        BOOST_TEST(report.pieces == piece_count(mesh));
        // Twice as thick as the cells of the third factor.
        if (2.0 * radius > 1.0 / (n - 1)) BOOST_TEST(report.pieces == 1);
        BOOST_TEST(!report.open);
        double worst = 0.0;
        for (Index i = 0; i < mesh.vertices.rows(); ++i)
          worst = std::max(worst, std::abs(shape(mesh.vertices.row(i).transpose())));
        BOOST_TEST(worst < 1.5 / (n - 1));  // three quarters of a cell
      }
}

BOOST_AUTO_TEST_CASE(what_is_not_thin_stays_as_it_is) {
  const auto shape = shapes::ball_and_box();
  ExtractionReport plain, refined;
  const TriangleMesh a = extract_surface(shape, 64, {}, &plain);
  const TriangleMesh b = extract_surface(shape, {.resolution = 64, .refine_thin = true}, {}, &refined);
  BOOST_TEST((a.vertices == b.vertices));
  BOOST_TEST((a.triangles == b.triangles));
  BOOST_TEST(plain.evaluations == refined.evaluations);
  BOOST_TEST(plain.pieces == 1);
  BOOST_TEST(plain.thin_cells == 0);
  BOOST_TEST(plain.notes.empty());
}

BOOST_AUTO_TEST_SUITE_END()
