// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/random.h"
#include "distance/welded_vertices.h"
#include "shapes.h"
#include "wrap/correspondence.h"
#include "wrap/smooth_map.h"
#include "wrap/target.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(wrap)

BOOST_AUTO_TEST_SUITE(smooth_map)

namespace {

/// Of lengths about 1, by equations whose condition is some 1e6.
constexpr double rounding = 1e-8;
/// Of a torus of length 2.8 that bends by up to half a radian, at places by the surface, and of J on average:
/// what 1,000 points tell of a map.
constexpr double by_points = 0.03, slope_by_points = 0.08;
/// Four steps of a fixed point leave that of ways of .2.
constexpr double there_and_back = 1e-3;
/// Standard deviation of noise, and the share of it that is left.
constexpr double noise = 0.01, left_of_noise = 0.6;

Mat3 affine() { return (Mat3() << 0.9, 0.3, -0.1, -0.2, 1.2, 0.4, 0.1, -0.3, 0.8).finished(); }

/// Bends space about z, more the farther out along x.
Vec3 bent(const Vec3& x) {
  const double angle = 0.4 * x[0];
  return Eigen::AngleAxisd(angle, Vec3::UnitZ()) * x;
}

Points moved(PointsIn points, const auto& map) {
  Points result(points.rows(), 3);
  for (Index i = 0; i < points.rows(); ++i) result.row(i) = map(Vec3(points.row(i))).transpose();
  return result;
}

Mat3 slope(const auto& map, const Vec3& x) {
  constexpr double step = 1e-5;
  Mat3 result;
  for (int k = 0; k < 3; ++k)
    result.col(k) = (map(x + step * Vec3::Unit(k)) - map(x - step * Vec3::Unit(k))) / (2.0 * step);
  return result;
}

}  // namespace

BOOST_AUTO_TEST_CASE(affine_maps_are_exact_everywhere) {
  const TriangleMesh torus = shapes::torus(40, 20);
  const auto map = [](const Vec3& x) -> Vec3 { return 1e3 * (affine() * x) + Vec3(4e3, 5e3, -6e3); };
  // Beside the surface the prior is not affine, but weighs little.
  const SmoothMap turned = surface_map(torus, moved(torus.vertices, [](const Vec3& x) -> Vec3 {
                                         return 7.0 * (Eigen::AngleAxisd(0.9, Vec3(0.6, 0.0, 0.8)) * x);
                                       }));
  const SmoothMap found = surface_map(torus, moved(torus.vertices, map));
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Vec3 x = 0.5 * random.direction();
    BOOST_TEST(
        (turned.at(x.transpose()).transpose() - 7.0 * (Eigen::AngleAxisd(0.9, Vec3(0.6, 0.0, 0.8)) * x))
            .norm() < 7.0 * rounding);
    BOOST_TEST((found.jacobians(x.transpose())[0] - 1e3 * affine()).norm() < 1e3 * slope_by_points);
  }
}

BOOST_AUTO_TEST_CASE(a_smooth_map_is_found_from_its_surface) {
  const TriangleMesh torus = shapes::torus(80, 40);
  const SmoothMap found = surface_map(torus, moved(torus.vertices, bent));
  const Points& x = torus.vertices;
  const std::vector<Mat3> jacobians = found.jacobians(x);
  Random random(2);
  double missed = 0.0, count = 0.0;
  for (Index i = 0; i < x.rows(); i += 37) {
    const Vec3 point = x.row(i);
    missed += (jacobians[i] - slope(bent, point)).norm();
    count += 1.0;
    const auto own = [&](const Vec3& y) -> Vec3 { return found.at(y.transpose()).transpose(); };
    BOOST_TEST((jacobians[i] - slope(own, point)).norm() < 1e-6);
    const Vec3 beside = point + 0.1 * random.direction();
    BOOST_TEST((own(beside) - bent(beside)).norm() < by_points);
  }
  BOOST_TEST(missed / count < slope_by_points);
}

BOOST_AUTO_TEST_CASE(noise_is_left_out) {
  const TriangleMesh torus = shapes::torus(80, 40);
  const Points told = moved(torus.vertices, bent);
  Points noisy = told;
  Random random(3);
  for (Index i = 0; i < noisy.rows(); ++i) noisy.row(i) += noise * random.direction().transpose();
  const Points found = surface_map(torus, noisy).at(torus.vertices);
  BOOST_TEST((found - told).rowwise().norm().mean() < left_of_noise * noise);
}

BOOST_AUTO_TEST_CASE(across_a_plane_space_grows_as_its_area_does) {
  constexpr int n = 12;
  TriangleMesh sheet{Points(n * n, 3), Triangles(2 * (n - 1) * (n - 1), 3)};
  for (int i = 0, t = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      sheet.vertices.row(i * n + j) << i, j, 0;
      if (i == n - 1 || j == n - 1) continue;
      sheet.triangles.row(t++) << i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1;
      sheet.triangles.row(t++) << i * n + j, (i + 1) * n + j + 1, i * n + j + 1;
    }
  const SmoothMap found = surface_map(
      sheet, moved(sheet.vertices, [](const Vec3& x) -> Vec3 { return {2.0 * x[1], 0.0, -2.0 * x[0]}; }));
  Mat3 told = Mat3::Zero();
  told(0, 1) = 2.0, told(2, 0) = told(1, 2) = -2.0;
  BOOST_TEST((found.jacobians(sheet.vertices.row(40))[0] - told).norm() < rounding);
}

BOOST_AUTO_TEST_CASE(few_centers_and_flat_ones_have_a_map) {
  for (const int count : {1, 2, 3, 4, 5, 30})
    for (const bool is_flat : {true, false}) {
      Random random(count);
      Points centers(count, 3);
      for (Index i = 0; i < count; ++i) centers.row(i) = random.direction().transpose();
      if (is_flat) centers.col(2).setConstant(0.7);
      const Points told = moved(centers, [](const Vec3& x) -> Vec3 { return affine() * x + Vec3(4, 5, -6); });
      const SmoothMap found = SmoothingSpline(centers, Vector::Constant(count, 1e-3)).fit(told);
      BOOST_TEST((found.at(centers) - told).cwiseAbs().maxCoeff() < rounding);
    }
}

BOOST_AUTO_TEST_CASE(displacements_follow_the_map_where_it_fits) {
  const TriangleMesh torus = shapes::torus(80, 40);
  const Points &x = torus.vertices, told = moved(x, bent);
  const SmoothMap map = surface_map(torus, told);
  std::vector<Mat3> given(x.rows());
  for (Index i = 0; i < x.rows(); ++i) given[i] = Mat3::Identity();
  const Points ways = Eigen::RowVector3d(0.05, -0.1, 0.15).replicate(x.rows(), 1);
  const DisplacementMap follows(map, x, told, given);
  BOOST_TEST((follows(ways) - (moved(x + ways, bent) - told)).rowwise().norm().maxCoeff() < by_points);
  const DisplacementMap elsewhere(map, x, told.rowwise() + Eigen::RowVector3d(50, 0, 0), given);
  BOOST_TEST((elsewhere(ways) - ways).norm() < 1e-3);
  BOOST_TEST(follows(Points::Zero(x.rows(), 3)).isZero(0.0));
  const DisplacementMap goes_back(map, x, told, given, true);
  BOOST_TEST((goes_back(follows(ways)) - ways).cwiseAbs().maxCoeff() < there_and_back);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(scan_noise)

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

BOOST_AUTO_TEST_SUITE(curvature)

namespace {

/// Samples of a graph z = f(x, y) over [−1, 1]², with upward normals.
struct Graph {
  Points points{4000, 3}, normals{4000, 3};

  template <class Height>
  explicit Graph(const Height& height) {
    constexpr double step = 1e-6;
    Random random(1);
    for (Index i = 0; i < points.rows(); ++i) {
      const double x = 2.0 * random.uniform() - 1.0, y = 2.0 * random.uniform() - 1.0;
      points.row(i) << x, y, height(x, y);
      normals.row(i) << (height(x - step, y) - height(x + step, y)) / (2.0 * step),
          (height(x, y - step) - height(x, y + step)) / (2.0 * step), 1.0;
      normals.row(i).normalize();
    }
  }
};

const Points origin = Points::Zero(1, 3), up = Vec3::UnitZ().transpose();
constexpr double radius = 0.2;
/// Of values about 0.1: fits see the surface's higher terms.
constexpr double by_fits = 4e-3;
/// Of sums of products of numbers about 1.
constexpr double rounding = 1e-12;

}  // namespace

BOOST_AUTO_TEST_CASE(curvature_of_quadrics) {
  const auto values = [](double a, double b, double c) {
    const Graph graph([&](double x, double y) { return a * x * x + b * x * y + c * y * y; });
    return curvature_values(graph.points, graph.normals, origin, up, radius, {});
  };
  const RowMatrix<double> dome = values(-0.5, 0.0, -0.5), saddle = values(0.5, 0.0, -0.5),
                          turned = values(0.0, 1.0, 0.0);
  BOOST_TEST(std::abs(dome(0, 0) + radius) < by_fits);
  BOOST_TEST(std::abs(dome(0, 1)) < by_fits);
  BOOST_TEST(std::abs(saddle(0, 0)) < by_fits);
  BOOST_TEST(std::abs(saddle(0, 1) - radius) < by_fits);
  BOOST_TEST((saddle - turned).cwiseAbs().maxCoeff() < by_fits);
}

BOOST_AUTO_TEST_CASE(gradients_of_curvature_agree_with_differences) {
  const Graph graph([](double x, double y) { return 0.25 * x * x + 0.1 * x * x * x + 0.05 * y * y; });
  constexpr double step = 0.02;
  Points places(3, 3);
  places << -step, 0.0, 0.0, 0.0, 0.0, 0.0, step, 0.0, 0.0;
  const SurfaceCurvature at =
      curvature_at(graph.points, graph.normals, places, up.replicate(3, 1), radius, {});
  for (int c = 0; c < 2; ++c) {
    const double difference = (at.values(2, c) - at.values(0, c)) / (2.0 * step);
    BOOST_TEST(std::abs(difference - 0.3 * radius) < 10.0 * by_fits);
    BOOST_TEST(std::abs(at.gradients(1, 3 * c) - difference) < 5.0 * by_fits);
    BOOST_TEST(std::abs(at.gradients(1, 3 * c + 1)) < 5.0 * by_fits);
    BOOST_TEST(at.gradients(1, 3 * c + 2) == 0.0);
  }
}

BOOST_AUTO_TEST_CASE(curvatures_of_a_shifted_surface_ask_for_the_shift) {
  const Graph graph([](double /*x*/, double /*y*/) { return 0.0; });
  const Vec3 shift(0.01, -0.02, 0.0);
  const Index n = graph.points.rows();
  Random random(2);
  WrapTarget target;
  target.points = graph.points;
  target.normals = graph.normals;
  target.interior = Vector::Ones(n);
  target.tree = OrientedPoints(target.points, target.normals);
  target.curvature = {radius, RowMatrix<double>::Zero(n, 2), RowMatrix<double>::Zero(n, 6)};
  for (Index i = 0; i < n; ++i)
    for (const int c : {0, 1, 3, 4}) target.curvature.gradients(i, c) = random.normal();
  SurfacePoints surface{graph.points, graph.normals, Vector::Constant(n, 1.0 / static_cast<double>(n)),
                        RowMatrix<double>(n, 2)};
  for (int c = 0; c < 2; ++c)
    surface.curvatures.col(c) = target.curvature.gradients.middleCols(3 * c, 3) * shift;
  const CorrespondenceTerms terms(target, surface, {.weight = 0.0, .coverage = 0.0, .curvature = 1.0});
  BOOST_TEST(terms.right_hand_sides.norm() > 0.0);
  for (Index i = 0; i < n; i += 100) {
    Mat3 form;
    const auto& q = terms.forms;
    form << q(i, 0), q(i, 3), q(i, 4), q(i, 3), q(i, 1), q(i, 5), q(i, 4), q(i, 5), q(i, 2);
    BOOST_TEST((form * shift - terms.right_hand_sides.row(i).transpose()).norm() < rounding * form.norm());
  }
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
