// SPDX-License-Identifier: GPL-3.0-or-later
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "core/errors.h"
#include "distance/signed_distance.h"
#include "extraction/extract_deformed.h"
#include "implicit_shapes.h"

using namespace arapfields;

BOOST_AUTO_TEST_SUITE(deformed_extraction)

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
