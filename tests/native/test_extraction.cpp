// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <array>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <map>
#include <numbers>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "distance/signed_distance.h"
#include "extraction/adaptive_mesh.h"
#include "extraction/batch_function.h"
#include "extraction/extract_deformed.h"
#include "extraction/extract_surface.h"
#include "implicit_shapes.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(extraction)

namespace {

/// Crossings on all edges of the whole grid, sorted: what marching cubes must find.
std::vector<std::array<double, 3>> dense_crossings(const ImplicitFunction& function, int n) {
  const auto coordinate = [&](int i) { return i + 1 == n ? 1.0 : i * (2.0 / (n - 1)) - 1.0; };
  PointsF points(static_cast<Index>(n) * n * n, 3);
  for (Index row = 0; row < points.rows(); ++row)
    points.row(row) << static_cast<float>(coordinate(static_cast<int>(row / (n * n)))),
        static_cast<float>(coordinate(static_cast<int>(row / n % n))),
        static_cast<float>(coordinate(static_cast<int>(row % n)));
  VectorF values(points.rows());
  function.evaluate(points, values);
  std::vector<std::array<double, 3>> found;
  const Index stride[3] = {static_cast<Index>(n) * n, n, 1};
  for (Index row = 0; row < points.rows(); ++row)
    for (int axis = 0; axis < 3; ++axis) {
      const int place[3] = {static_cast<int>(row / (n * n)), static_cast<int>(row / n % n),
                            static_cast<int>(row % n)};
      if (place[axis] + 1 == n) continue;
      const double a = values[row], b = values[row + stride[axis]];
      if ((a < 0.0) == (b < 0.0)) continue;
      std::array<double, 3> x{coordinate(place[0]), coordinate(place[1]), coordinate(place[2])};
      x[static_cast<std::size_t>(axis)] +=
          a / (a - b) * (coordinate(place[axis] + 1) - coordinate(place[axis]));
      found.push_back(x);
    }
  return found;
}

/// Largest distance between two sets of equally many points, by greedy matching in sorted cells.
double set_distance(const std::vector<std::array<double, 3>>& a, const Points& b) {
  std::map<std::array<Index, 3>, std::vector<std::size_t>> cells;
  const auto key = [](const double* x) {
    return std::array<Index, 3>{std::lround(x[0] * 1e4), std::lround(x[1] * 1e4), std::lround(x[2] * 1e4)};
  };
  for (std::size_t i = 0; i < a.size(); ++i) cells[key(a[i].data())].push_back(i);
  double worst = 0.0;
  for (Index row = 0; row < b.rows(); ++row) {
    const double x[3] = {b(row, 0), b(row, 1), b(row, 2)};
    const auto base = key(x);
    double best = 1.0;
    for (Index n = 0; n < 27; ++n) {
      const auto cell = cells.find({base[0] + n / 9 - 1, base[1] + n / 3 % 3 - 1, base[2] + n % 3 - 1});
      if (cell == cells.end()) continue;
      for (const std::size_t i : cell->second)
        best = std::min(best, std::hypot(a[i][0] - x[0], a[i][1] - x[1], a[i][2] - x[2]));
    }
    worst = std::max(worst, best);
  }
  return worst;
}

struct Topology {
  Index euler = 0;
  Index boundary = 0;      // edges with one triangle
  Index inconsistent = 0;  // edges that two triangles run through in the same direction, or that have three
  double volume = 0.0;
};

Topology topology(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, std::pair<int, int>> edges;  // uses forwards, backwards
  Topology result;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    for (int c = 0; c < 3; ++c) {
      const int a = mesh.triangles(t, c), b = mesh.triangles(t, (c + 1) % 3);
      auto& uses = edges[{std::min(a, b), std::max(a, b)}];
      ++(a < b ? uses.first : uses.second);
    }
    const Vec3 a = mesh.vertices.row(mesh.triangles(t, 0)), b = mesh.vertices.row(mesh.triangles(t, 1)),
               c = mesh.vertices.row(mesh.triangles(t, 2));
    result.volume += a.dot(b.cross(c)) / 6.0;
  }
  for (const auto& [edge, uses] : edges) {
    result.boundary += uses.first + uses.second == 1;
    result.inconsistent += uses.first > 1 || uses.second > 1;
  }
  result.euler = mesh.vertices.rows() - static_cast<Index>(edges.size()) + mesh.triangles.rows();
  return result;
}

TriangleMesh extract(const ImplicitFunction& function, int resolution, ExtractionReport* report = nullptr) {
  return extract_surface(function, resolution, {}, report);
}

void check_closed(const TriangleMesh& mesh) {
  const Topology found = topology(mesh);
  BOOST_TEST(found.boundary == 0);
  BOOST_TEST(found.inconsistent == 0);
}

}  // namespace

BOOST_AUTO_TEST_CASE(topology_volume_and_orientation) {
  const TriangleMesh ball = extract(shapes::sphere(0.6, Vec3(0.05, 0.1, -0.1)), 64);
  check_closed(ball);
  BOOST_TEST(topology(ball).euler == 2);
  // The polyhedron is inscribed: its volume falls short by the order of (grid step / radius)².
  BOOST_TEST(std::abs(topology(ball).volume / (4.0 / 3.0 * std::numbers::pi * 0.216) - 1.0) < 5e-3);
  const TriangleMesh ring = extract(shapes::torus(0.55, 0.25), 64);
  check_closed(ring);
  BOOST_TEST(topology(ring).euler == 0);
  BOOST_TEST(topology(ring).volume > 0.0);
}

BOOST_AUTO_TEST_CASE(vertices_are_those_of_the_whole_grid) {
  const shapes::Analytic needle([](const Vec3& x) {  // steep where gradient samples hardly fall
    return x.norm() - 0.4 - 0.3 * std::exp(-(x[1] * x[1] + x[2] * x[2]) / (2.0 * 0.012 * 0.012));
  });
  const shapes::Analytic shell([](const Vec3& x) { return std::abs(x.norm() - 0.6) - 0.02; });
  const shapes::Analytic all[] = {shapes::sphere(0.6),
                                  shapes::torus(0.5, 0.1),
                                  shapes::ball_and_box(),
                                  shapes::box(Vec3(0.8, 0.6, 0.01)),
                                  needle,
                                  shell};
  for (const auto& shape : all) {
    for (const int n : {17, 63, 101}) {
      ExtractionReport report;
      const TriangleMesh mesh = extract(shape, n, &report);
      const auto expected = dense_crossings(shape, n);
      BOOST_TEST(static_cast<Index>(expected.size()) == mesh.vertices.rows());
      BOOST_TEST(set_distance(expected, mesh.vertices) < 1e-6);
      check_closed(mesh);
    }
  }
  ExtractionReport report;
  extract(shapes::sphere(0.6), 128, &report);
  BOOST_TEST(report.evaluations < 0.06 * static_cast<double>(report.dense_evaluations));
  BOOST_TEST(!report.open);
}

BOOST_AUTO_TEST_CASE(a_single_grid_point_between_two_close_sheets) {
  for (std::uint64_t trial = 0; trial < 60; ++trial) {
    Random random(27, trial);
    const int n = 110 + static_cast<int>(random.below(18));
    const double step = 2.0 / (n - 1);
    Vec3 point, normal;
    for (int axis = 0; axis < 3; ++axis) {
      point[axis] = std::floor((0.35 + 0.3 * random.uniform()) * n) * step - 1.0;
      normal[axis] = random.uniform() - 0.5;
    }
    normal.normalize();
    const auto shape = shapes::finned_ball(point, normal, 0.15 + 0.2 * random.uniform());
    const TriangleMesh mesh = extract(shape, n);
    int expected = 0, found = 0;  // on the six edges from the point
    for (int axis = 0; axis < 3; ++axis)
      for (const double way : {-step, step}) expected += shape(point + way * Vec3::Unit(axis)) >= 0.0;
    for (Index row = 0; row < mesh.vertices.rows(); ++row) {
      const Vec3 apart = (mesh.vertices.row(row).transpose() - point).cwiseAbs();
      found += apart.maxCoeff() < step && apart.maxCoeff() > apart.sum() - 1e-9;
    }
    BOOST_TEST(shape(point) < 0.0);
    BOOST_TEST(found == expected);
  }
}

BOOST_AUTO_TEST_CASE(a_known_bound_on_the_gradient_leaves_nothing_to_chance) {
  // Distances: to thin sheets that no measurement need meet, and to a ball that grid points touch.
  shapes::Analytic all[] = {shapes::box(Vec3(0.8, 0.6, 0.002)), shapes::sphere(0.5),
                            shapes::torus(0.5, 0.02)};
  for (auto& shape : all) {
    shape.bound = 1.0;
    for (const int n : {17, 40, 101, 128}) {
      ExtractionReport report;
      const auto expected = dense_crossings(shape, n);
      if (expected.empty()) continue;
      const TriangleMesh mesh = extract(shape, n, &report);
      BOOST_TEST(static_cast<Index>(expected.size()) == mesh.vertices.rows());
      BOOST_TEST(set_distance(expected, mesh.vertices) < 1e-6);
      check_closed(mesh);
      if (n == 128) BOOST_TEST(report.evaluations < 0.1 * static_cast<double>(report.dense_evaluations));
    }
  }
}

BOOST_AUTO_TEST_CASE(noise_gives_closed_manifolds) {
  // Independent signs at all grid points but the outermost: every pattern of cells and ambiguous faces.
  for (const int magnitude : {1, 5}) {  // whole numbers from −magnitude: zeros and equal saddles as well
    const int n = 20;
    const shapes::Analytic noise([&](const Vec3& x) {
      Eigen::Array3d place = (x.array() + 1.0) * (0.5 * (n - 1));
      const Eigen::Array3i grid = place.round().cast<int>();
      if ((grid == 0).any() || (grid == n - 1).any()) return 1.0;
      Random random(3, static_cast<std::uint64_t>((grid[0] * n + grid[1]) * n + grid[2]));
      return static_cast<double>(random.below(2 * magnitude + 1)) - magnitude;
    });
    const TriangleMesh mesh = extract(noise, n);
    BOOST_TEST(mesh.triangles.rows() > 10000);
    check_closed(mesh);
    for (Index t = 0; t < mesh.triangles.rows(); ++t) {
      const Vec3 a = mesh.vertices.row(mesh.triangles(t, 0)), b = mesh.vertices.row(mesh.triangles(t, 1)),
                 c = mesh.vertices.row(mesh.triangles(t, 2));
      BOOST_REQUIRE((b - a).cross(c - a).norm() > 0.0);
    }
  }
}

BOOST_AUTO_TEST_CASE(tunnels_through_a_cell) {
  // Three negative grid points, a pair and a single one diagonal to it; on the face between them the positive
  // corners prevail. Small values at the cell's far corners join the two inside it: one sphere instead of
  // two.
  for (const double sign : {1.0, -1.0})
    for (const bool joined : {true, false}) {
      const shapes::Analytic cell([&](const Vec3& x) {
        const int n = 8;
        const Eigen::Array3i grid = ((x.array() + 1.0) * (0.5 * (n - 1))).round().cast<int>();
        if ((grid == 0).any() || (grid == n - 1).any()) return 1.0;  // the whole is closed for either sign
        const Eigen::Array3i at = grid - 3;
        if ((at < 0).any() || (at > 1).any()) return sign;
        const int corner = 4 * at[0] + 2 * at[1] + at[2];
        const double far = joined ? 0.05 : 1.0;
        const double values[8] = {-1.0, -1.0, 1.05, far, 1.05, far, -1.0, far};
        return sign * values[corner];
      });
      const TriangleMesh mesh = extract(cell, 8);
      check_closed(mesh);
      BOOST_TEST(topology(mesh).euler == (joined ? 2 : 4) + (sign < 0.0 ? 2 : 0));
    }
}

BOOST_AUTO_TEST_CASE(zeros_on_grid_points) {
  // On 17 points a side the faces of this cube lie in grid planes, and so do the sphere's poles.
  check_closed(extract(shapes::box(Vec3::Constant(0.5)), 17));
  check_closed(extract(shapes::box(Vec3::Constant(0.5)), 65));
  check_closed(extract(shapes::sphere(0.5), 65));
}

BOOST_AUTO_TEST_CASE(a_surface_that_leaves_the_cube_is_open_there) {
  ExtractionReport report;
  const TriangleMesh mesh = extract(shapes::sphere(0.8, Vec3(0.9, 0, 0)), 64, &report);
  BOOST_TEST(report.open);
  const Topology found = topology(mesh);
  BOOST_TEST(found.inconsistent == 0);
  BOOST_TEST(found.euler == 1);  // a disk
  std::map<std::pair<int, int>, int> uses;
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) {
      const int a = mesh.triangles(t, c), b = mesh.triangles(t, (c + 1) % 3);
      ++uses[{std::min(a, b), std::max(a, b)}];
    }
  for (const auto& [edge, count] : uses)
    if (count == 1)
      BOOST_REQUIRE((mesh.vertices(edge.first, 0) == 1.0 && mesh.vertices(edge.second, 0) == 1.0));
}

BOOST_AUTO_TEST_CASE(any_call_can_be_extracted) {
  // The sphere seen through the inverse of a stretch along x is an ellipsoid.
  const auto ball = shapes::sphere(0.4);
  const BatchFunction stretched([&](ConstPointsRef<float> points, Eigen::Ref<VectorF> values) {
    PointsF rest = points;
    rest.col(0) /= 2.0f;
    ball.evaluate(rest, values);
  });
  const TriangleMesh mesh = extract(stretched, 72);
  check_closed(mesh);
  BOOST_TEST(mesh.vertices.col(0).maxCoeff() > 0.79);
  BOOST_TEST(mesh.vertices.col(1).maxCoeff() < 0.401);
  BOOST_TEST(set_distance(dense_crossings(stretched, 72), mesh.vertices) < 1e-6);
}

BOOST_AUTO_TEST_CASE(extraction_repeats_and_does_not_depend_on_threads) {
  const auto shape = shapes::ball_and_box();
  const TriangleMesh a = extract(shape, 80);
  const ThreadScope one(1);
  const TriangleMesh b = extract(shape, 80);
  BOOST_TEST((a.vertices == b.vertices));
  BOOST_TEST((a.triangles == b.triangles));
}

BOOST_AUTO_TEST_CASE(frame_cancel_and_bad_input) {
  const auto shape = shapes::sphere(0.5);
  auto placed = shape;
  const Frame frame = placed.place = {Vec3(1, 2, 3), 2.0};
  const TriangleMesh moved = extract_surface(placed, 40), plain = extract(shape, 40);
  BOOST_TEST((moved.vertices - frame.to_mesh(plain.vertices)).norm() == 0.0);
  BOOST_CHECK_THROW(extract(shape, 7), InvalidInput);
  BOOST_CHECK_THROW(extract(shape, 513), InvalidInput);
  BOOST_CHECK_THROW(extract(shapes::Analytic([](const Vec3&) { return 1.0; }), 64), InvalidInput);
  BOOST_CHECK_THROW(extract(shapes::Analytic([](const Vec3& x) { return std::sqrt(x[0]); }), 64),
                    InvalidInput);
  Task task;
  task.cancel();
  BOOST_CHECK_THROW(extract_surface(shape, 64, Progress(&task)), Cancelled);
  Task watched;
  extract_surface(shape, 64, Progress(&watched));
  BOOST_TEST(watched.progress() == 1.0);
}

BOOST_AUTO_TEST_SUITE(deformed)

namespace {

/// A bend of the cube about y: x becomes the angle around an axis at z = −1/curvature. Its inverse is known.
class Bend final : public DeformationField {
 public:
  explicit Bend(double curvature, bool backwards = false) : curvature_(curvature), backwards_(backwards) {}

  void evaluate(PointsIn points, JetView<double> out) const override {
    for (Index p = 0; p < points.rows(); ++p) {
      const double x = points(p, 0), y = points(p, 1), z = points(p, 2), center = 1.0 / curvature_;
      double* value = out.at(0, p);
      if (backwards_) {
        const double radius = std::hypot(x, z + center);
        value[0] = center * std::atan2(x, z + center), value[1] = y, value[2] = radius - center;
        continue;
      }
      const double angle = curvature_ * x, radius = z + center, s = std::sin(angle), c = std::cos(angle);
      value[0] = radius * s, value[1] = y, value[2] = radius * c - center;
      if (out.order == JetOrder::value) continue;
      const double columns[3][3] = {
          {curvature_ * radius * c, 0.0, -curvature_ * radius * s}, {0.0, 1.0, 0.0}, {s, 0.0, c}};
      for (int j = 0; j < 3; ++j) std::copy_n(columns[j], 3, out.at(first_column(j), p));
    }
  }

 private:
  double curvature_;
  bool backwards_;
};

/// A field that is NaN everywhere.
class Nowhere final : public DeformationField {
 public:
  void evaluate(PointsIn points, JetView<double> out) const override {
    std::fill_n(out.data, 3 * points.rows(), std::nan(""));
  }
};

double apart(const TriangleMesh& a, const TriangleMesh& b) {
  Vector forth(a.vertices.rows()), back(b.vertices.rows());
  SignedDistance(b.vertices, b.triangles).unsigned_distance(a.vertices, forth);
  SignedDistance(a.vertices, a.triangles).unsigned_distance(b.vertices, back);
  return std::max(forth.maxCoeff(), back.maxCoeff());
}

TriangleMesh warped(const ImplicitFunction& shape, const DeformationField& field, int n) {
  TriangleMesh mesh = extract_surface(shape, n);
  Points moved(mesh.vertices.rows(), 3);
  field.evaluate(field.frame().to_cube(mesh.vertices), {moved.data(), moved.rows(), JetOrder::value});
  mesh.vertices = field.frame().to_mesh(moved);
  return mesh;
}

}  // namespace

BOOST_AUTO_TEST_CASE(equals_the_moved_surface_by_either_inverse) {
  const auto bar = shapes::box(Vec3(0.8, 0.2, 0.15));
  const Bend bend(1.2), back(1.2, true);
  const TriangleMesh moved = warped(bar, bend, 64);
  for (const DeformationField* inverse :
       {static_cast<const DeformationField*>(nullptr), static_cast<const DeformationField*>(&back)}) {
    DeformedReport report;
    const TriangleMesh mesh = extract_deformed(bar, bend, inverse, 64, {}, &report);
    BOOST_TEST(apart(mesh, moved) < 1.5 * 2.0 / 63);
    BOOST_TEST(report.failures == 0);
    BOOST_TEST(report.inverted < report.dense_evaluations / 4);
    BOOST_TEST(!report.open);
    Vector inside(1);
    SignedDistance(mesh.vertices, mesh.triangles).evaluate(Points::Zero(1, 3), inside);
    BOOST_TEST(inside[0] < -0.1);
  }
}

BOOST_AUTO_TEST_CASE(vertices_lie_on_the_surface) {
  // Each vertex's rest position is where Φ is zero up to the interpolation within a cell.
  const auto ball = shapes::sphere(0.5);
  const Bend bend(0.8), back(0.8, true);
  DeformedReport report;
  const TriangleMesh mesh = extract_deformed(ball, bend, nullptr, 72, {}, &report);
  Points rest(mesh.vertices.rows(), 3);
  back.evaluate(mesh.vertices, {rest.data(), rest.rows(), JetOrder::value});
  const double worst = (rest.rowwise().norm().array() - 0.5).abs().maxCoeff();
  BOOST_TEST(worst < report.spacing * report.spacing / 0.5);
}

BOOST_AUTO_TEST_CASE(frames_may_differ) {
  auto ball = shapes::sphere(0.6);
  ball.place = {Vec3(3, 0, 0), 2.0};
  Bend bend(0.5);
  bend.set_frame({Vec3(3, 0, 1), 4.0});
  const TriangleMesh moved = warped(ball, bend, 48);
  DeformedReport report;
  const TriangleMesh mesh = extract_deformed(ball, bend, nullptr, 48, {}, &report);
  BOOST_TEST(apart(mesh, moved) < 1.5 * report.spacing);
}

BOOST_AUTO_TEST_CASE(progress_cancel_and_bad_input) {
  const auto ball = shapes::sphere(0.5);
  const Bend bend(0.8);
  BOOST_CHECK_THROW(extract_deformed(ball, bend, nullptr, 7), InvalidInput);
  BOOST_CHECK_THROW(extract_deformed(ball, Nowhere(), nullptr, 32), InvalidInput);
  Task task, watched;
  task.cancel();
  BOOST_CHECK_THROW(extract_deformed(ball, bend, nullptr, 32, Progress(&task)), Cancelled);
  extract_deformed(ball, bend, nullptr, 32, Progress(&watched));
  BOOST_TEST(watched.progress() == 1.0);
}

BOOST_AUTO_TEST_SUITE_END()

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

BOOST_AUTO_TEST_SUITE_END()
