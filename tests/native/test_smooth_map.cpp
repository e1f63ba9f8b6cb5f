// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Dense>
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "core/random.h"
#include "shapes.h"
#include "wrap/smooth_map.h"

using namespace arapfields;

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

BOOST_AUTO_TEST_SUITE(smooth_map)

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
