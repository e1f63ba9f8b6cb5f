// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <boost/test/unit_test.hpp>
#include <set>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/hierarchy.h"
#include "distance/kernels.h"
#include "distance/signed_distance.h"
#include "distance/training_points.h"
#include "distance/triangle_crossings.h"
#include "mesh/is_closed.h"
#include "mesh/pieces.h"
#include "mesh/sample_mesh.h"
#include "shapes.h"

using namespace arapfields;

namespace {

/// Distance to a segment and to a triangle as textbooks have them, one case at a time.
double to_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const double square = (b - a).squaredNorm();
  const double t = square > 0 ? std::clamp((p - a).dot(b - a) / square, 0.0, 1.0) : 0.0;
  return (a + t * (b - a) - p).norm();
}

double to_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  // Of a triangle that is a line up to rounding, this normal is noise: its sides are all there is.
  const bool has_plane = n.norm() > 1e-12 * (b - a).norm() * (c - a).norm();
  const bool inside = has_plane && n.cross(b - a).dot(p - a) > 0 && n.cross(c - b).dot(p - b) > 0 &&
                      n.cross(a - c).dot(p - c) > 0;
  if (inside) return std::abs((p - a).dot(n)) / n.norm();
  return std::min({to_segment(p, a, b), to_segment(p, b, c), to_segment(p, c, a)});
}

double solid_angle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 u = a - p, v = b - p, w = c - p;
  const double x = u.norm(), y = v.norm(), z = w.norm();
  return 2 * std::atan2(u.dot(v.cross(w)), x * y * z + u.dot(v) * z + v.dot(w) * x + w.dot(u) * y);
}

template <class Call>
auto over_triangles(const TriangleMesh& mesh, const Vec3& p, Call&& call) {
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto row = mesh.triangles.row(t);
    call(p, mesh.vertices.row(row[0]).transpose(), mesh.vertices.row(row[1]).transpose(),
         mesh.vertices.row(row[2]).transpose());
  }
}

double brute_force(const TriangleMesh& mesh, const Vec3& p) {
  double best = INFINITY;
  over_triangles(mesh, p, [&](auto&&... args) { best = std::min(best, to_triangle(args...)); });
  return best;
}

double brute_force_winding(const TriangleMesh& mesh, const Vec3& p) {
  double sum = 0;
  over_triangles(mesh, p, [&](auto&&... args) { sum += solid_angle(args...); });
  return sum / (4 * std::numbers::pi);
}

using NearestKernel = void (*)(const HierarchyView&, const double*, std::int64_t, Nearest*);

/// Pairs of hierarchy search and brute force for every instruction set that this processor has.
std::vector<std::pair<NearestKernel, NearestKernel>> nearest_kernels() {
  std::vector<std::pair<NearestKernel, NearestKernel>> kernels;
#ifndef __APPLE__
  kernels.emplace_back(baseline::nearest, baseline::nearest_of_all);
#endif
#if defined(__x86_64__)
  if (simd_level() >= SimdLevel::avx2) kernels.emplace_back(avx2::nearest, avx2::nearest_of_all);
  if (simd_level() >= SimdLevel::avx512) kernels.emplace_back(avx512::nearest, avx512::nearest_of_all);
#elif defined(__aarch64__)
  kernels.emplace_back(neon::nearest, neon::nearest_of_all);
#endif
  return kernels;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(distance)

BOOST_AUTO_TEST_CASE(hierarchy_equals_brute_force_exactly) {
  for (const int count : {1, 2, 8, 9, 60, 700}) {
    const TriangleMesh mesh = shapes::soup(count, static_cast<std::uint64_t>(count));
    const Hierarchy hierarchy(mesh.vertices, mesh.triangles);
    Points queries = shapes::queries(mesh, 500, 3);
    for (Index i = 0; i < queries.rows(); ++i)
      queries.row(i) = hierarchy.normalized(queries.row(i).transpose()).transpose();
    for (const auto& [search, all] : nearest_kernels()) {
      std::vector<Nearest> found(500), expected(500);
      search(hierarchy.view(), queries.data(), 500, found.data());
      all(hierarchy.view(), queries.data(), 500, expected.data());
      for (std::size_t i = 0; i < 500; ++i) {
        BOOST_TEST(found[i].squared_distance == expected[i].squared_distance);
        BOOST_TEST(found[i].triangle == expected[i].triangle);
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(distances_and_closest_points_agree_with_textbook_formulas) {
  for (const TriangleMesh& mesh : {shapes::soup(90, 5), shapes::torus(20, 10)}) {
    const Points queries = shapes::queries(mesh, 600, 4);
    const SignedDistance distance(mesh.vertices, mesh.triangles);
    const ClosestPoints closest = distance.closest(queries);
    Vector alone(queries.rows()), both(queries.rows());
    distance.evaluate(queries, alone);
    BOOST_TEST((distance.evaluate_closest(queries, both).points == closest.points && alone == both));
    for (Index i = 0; i < queries.rows(); ++i) {
      const Vec3 q = queries.row(i).transpose(), c = closest.points.row(i).transpose();
      const double rounding = 1e-14 * (1 + q.norm());
      BOOST_TEST(std::abs(closest.distances[i] - brute_force(mesh, q)) < rounding);
      BOOST_TEST(std::abs((c - q).norm() - closest.distances[i]) < rounding);
      const auto t = mesh.triangles.row(closest.triangles[static_cast<std::size_t>(i)]);
      BOOST_TEST(to_triangle(c, mesh.vertices.row(t[0]).transpose(), mesh.vertices.row(t[1]).transpose(),
                             mesh.vertices.row(t[2]).transpose()) < rounding);
    }
  }
}

BOOST_AUTO_TEST_CASE(needles_keep_their_plane) {
  for (const double height : {1e-3, 1e-9, 1e-13, 0.0}) {
    TriangleMesh needle{Points(3, 3), Triangles(1, 3)};
    const Vec3 along = Vec3(1, 2, 3).normalized(), up = Vec3(3, 0, -1).normalized();
    needle.vertices.row(0).setZero();
    needle.vertices.row(1) = along.transpose();
    needle.vertices.row(2) = (0.6 * along + height * up).transpose();
    needle.triangles << 0, 1, 2;
    const SignedDistance distance(needle.vertices, needle.triangles);
    const Vec3 normal = along.cross(up);
    Points queries(3, 3);
    queries << (0.5 * along + 0.3 * height * up + 0.2 * normal).transpose(),
        (0.4 * along - 0.1 * up).transpose(), (2 * along).transpose();
    Vector found(3);
    distance.unsigned_distance(queries, found);
    BOOST_TEST(std::abs(found[0] - 0.2) < 1e-15);
    BOOST_TEST(std::abs(found[1] - 0.1) < 1e-15);
    BOOST_TEST(std::abs(found[2] - 1.0) < 1e-15);
  }
}

BOOST_AUTO_TEST_CASE(winding_numbers_agree_with_sums_of_solid_angles) {
  TriangleMesh open = shapes::torus(40, 20);
  open.triangles = open.triangles.topRows(1100).eval();
  for (const TriangleMesh& mesh : {shapes::soup(300, 8), shapes::torus(40, 20), open}) {
    Points queries = shapes::queries(mesh, 400, 6);
    Vector numbers(queries.rows());
    SignedDistance(mesh.vertices, mesh.triangles).winding_number(queries, numbers);
    for (Index i = 0; i < queries.rows(); ++i) {
      if (i % 5 == 2 || i % 5 == 4) continue;  // on the surface the number jumps
      BOOST_TEST(std::abs(numbers[i] - brute_force_winding(mesh, queries.row(i).transpose())) < 1e-3);
    }
  }
}

BOOST_AUTO_TEST_CASE(closed_meshes_take_the_winding_number_of_their_neighbourhood) {
  const TriangleMesh torus = shapes::torus(60, 30);
  TriangleMesh twice{Points(2 * torus.vertices.rows(), 3), Triangles(2 * torus.triangles.rows(), 3)};
  twice.vertices << torus.vertices, torus.vertices.rowwise() + Eigen::RowVector3d(0.7, 0.2, 0.1);
  twice.triangles << torus.triangles,
      torus.triangles.array() + static_cast<std::int32_t>(torus.vertices.rows());
  TriangleMesh inverted = torus;
  inverted.triangles.col(0).swap(inverted.triangles.col(1));
  for (const TriangleMesh& mesh : {torus, twice, inverted}) {
    const SignedDistance distance(mesh.vertices, mesh.triangles);
    BOOST_TEST(distance.is_closed());
    const Points queries = shapes::queries(mesh, 2000, 9);
    Vector found(queries.rows());
    distance.evaluate(queries, found);
    for (Index i = 0; i < queries.rows(); ++i)
      if (std::abs(found[i]) > 1e-12)
        BOOST_TEST((found[i] < 0) == (brute_force_winding(mesh, queries.row(i).transpose()) > 0.5));
  }
}

BOOST_AUTO_TEST_CASE(closedness_counts_oriented_edges_at_positions) {
  const TriangleMesh torus = shapes::torus(12, 8);
  BOOST_TEST(is_closed(torus.vertices, torus.triangles));
  TriangleMesh unwelded{Points(3 * torus.triangles.rows(), 3), Triangles(torus.triangles.rows(), 3)};
  for (Index i = 0; i < torus.triangles.size(); ++i) {
    unwelded.vertices.row(i) = torus.vertices.row(torus.triangles.data()[i]);
    unwelded.triangles.data()[i] = static_cast<std::int32_t>(i);
  }
  BOOST_TEST(is_closed(unwelded.vertices, unwelded.triangles));
  BOOST_TEST(!is_closed(torus.vertices, torus.triangles.topRows(191)));
  Triangles one_turned = torus.triangles;
  std::swap(one_turned(5, 0), one_turned(5, 1));
  BOOST_TEST(!is_closed(torus.vertices, one_turned));
}

namespace {

/// Two closed boxes facing outwards, with a vertex of its own for each corner of a triangle: the unit cube,
/// and it moved by `step`.
TriangleMesh two_boxes(const Vec3& step) {
  const int quads[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1},
                           {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
  const int corners[6] = {0, 1, 2, 0, 2, 3};
  TriangleMesh mesh{Points(72, 3), Triangles(24, 3)};
  for (int i = 0; i < 72; ++i) {
    const int corner = quads[i % 36 / 6][corners[i % 6]];
    for (int k = 0; k < 3; ++k) mesh.vertices(i, k) = (corner >> (2 - k) & 1) + (i < 36 ? 0.0 : step[k]);
    mesh.triangles(i / 3, i % 3) = i;
  }
  return mesh;
}

}  // namespace

BOOST_AUTO_TEST_CASE(solids_that_touch_are_pieces_of_their_own) {
  for (const Vec3& step : {Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(1, 1, 1)}) {  // along a face, an edge, a corner
    const std::vector<std::int32_t> pieces = pieces_of(two_boxes(step));
    for (std::size_t t = 0; t < 24; ++t) BOOST_TEST(pieces[t] == (t < 12 ? 0 : 1));
  }
}

BOOST_AUTO_TEST_CASE(vertices_are_joined_along_seams_and_not_across_walls_that_touch) {
  for (const Vec3& step : {Vec3(1, 0, 0), Vec3(1, 1, 0), Vec3(1, 1, 1)}) {
    const std::vector<std::int32_t> joined = joined_vertices(two_boxes(step));  // three to six at each corner
    for (const int begin : {0, 36}) {
      const std::set<std::int32_t> corners(joined.begin() + begin, joined.begin() + begin + 36);
      BOOST_TEST(corners.size() == 8);
      BOOST_TEST((*corners.begin() >= begin && *corners.rbegin() < begin + 36));
    }
  }
}

BOOST_AUTO_TEST_CASE(walls_of_a_slit_are_of_one_piece) {
  // Without one triangle of the wall between the boxes, on both sides, what is left of it is a slit.
  TriangleMesh mesh = two_boxes(Vec3(1, 0, 0));
  for (const Index row : {13, 2}) {
    const Index below = mesh.triangles.rows() - 1 - row;
    mesh.triangles.middleRows(row, below) = Triangles(mesh.triangles.bottomRows(below));
    mesh.triangles.conservativeResize(row + below, 3);
  }
  BOOST_TEST(is_closed(mesh.vertices, mesh.triangles));
  for (const std::int32_t piece : pieces_of(mesh)) BOOST_TEST(piece == 0);
}

BOOST_AUTO_TEST_CASE(open_pieces_are_joined_by_vertices) {
  TriangleMesh mesh{Points(5, 3), Triangles(2, 3)};
  mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1, 0;
  mesh.triangles << 0, 1, 2, 0, 3, 4;
  for (const std::int32_t piece : pieces_of(mesh)) BOOST_TEST(piece == 0);
}

BOOST_AUTO_TEST_CASE(results_do_not_depend_on_threads_and_a_cancel_is_heard) {
  const TriangleMesh mesh = shapes::torus(200, 100);
  const Points queries = shapes::queries(mesh, 5000, 2);
  const Vector one = signed_distance(mesh.vertices, mesh.triangles, queries, 1);
  BOOST_TEST((one.array() == signed_distance(mesh.vertices, mesh.triangles, queries, 2).array()).all());
  BOOST_TEST((one.array() == signed_distance(mesh.vertices, mesh.triangles, queries, 5).array()).all());
  Task task;
  const Progress progress(&task);
  BOOST_TEST(
      (one.array() == signed_distance(mesh.vertices, mesh.triangles, queries, 2, progress).array()).all());
  BOOST_TEST(task.progress() == 1.0);
  task.cancel();
  BOOST_CHECK_THROW(signed_distance(mesh.vertices, mesh.triangles, queries, 2, progress), Cancelled);
}

BOOST_AUTO_TEST_CASE(training_points_carry_exact_distances_in_cube_units) {
  TriangleMesh mesh = shapes::torus(50, 30);
  mesh.vertices = ((3.0 * mesh.vertices).rowwise() + Eigen::RowVector3d(10, 20, 30)).eval();
  const SignedDistance distance(mesh.vertices, mesh.triangles);
  const Frame frame = mesh_frame(mesh.vertices, mesh.triangles);
  TrainingPointsOptions options;
  options.near_points = 4000;
  options.uniform_points = 1000;
  const TrainingPoints all = training_points(distance, mesh, frame, options);
  BOOST_TEST(all.points.rows() == 5000);
  BOOST_TEST(all.near_surface == 4000);
  BOOST_TEST(all.points.cwiseAbs().maxCoeff() <= 1.0f);
  const TriangleMesh in_cube{frame.to_cube(mesh.vertices), mesh.triangles};
  double fine = 0, coarse = 0;
  for (Index i = 0; i < 5000; i += 7) {
    const double expected = brute_force(in_cube, all.points.row(i).cast<double>().transpose());
    BOOST_TEST(std::abs(std::abs(all.distances[i]) - expected) < 1e-6);
  }
  for (Index i = 0; i < 4000; ++i) (i % 2 == 0 ? fine : coarse) += std::abs(all.distances[i]) / 2000;
  // The mean distance from a plane is sqrt(2/π) = 0.80 standard deviations.
  BOOST_TEST((fine > 0.007 && fine < 0.009));
  BOOST_TEST((coarse > 0.030 && coarse < 0.045));
  const TrainingPoints again = training_points(distance, mesh, frame, options);
  BOOST_TEST((all.points == again.points && all.distances == again.distances));
  BOOST_TEST((training_points(distance, mesh, frame, options, 1).points != all.points));
  options.near_spread = 0;
  BOOST_CHECK_THROW(training_points(distance, mesh, frame, options), InvalidInput);
}

BOOST_AUTO_TEST_SUITE(crossings)

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

BOOST_AUTO_TEST_SUITE_END()
