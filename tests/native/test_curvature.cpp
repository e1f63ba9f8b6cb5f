// SPDX-License-Identifier: GPL-3.0-or-later
#include <boost/test/unit_test.hpp>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "wrap/correspondence.h"
#include "wrap/curvature.h"

using namespace arapfields;

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

BOOST_AUTO_TEST_SUITE(curvature)

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
