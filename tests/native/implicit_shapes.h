// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit functions with known surfaces, for tests.
#pragma once

#include <Eigen/Geometry>
#include <atomic>
#include <cmath>
#include <functional>

#include "core/implicit.h"

namespace arapfields::shapes {

/// Any function of a point, with gradients by central differences; counts its evaluations.
class Analytic : public ImplicitFunction {
 public:
  using Formula = std::function<double(const Vec3&)>;
  explicit Analytic(Formula formula) : formula_(std::move(formula)) {}

  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override {
    for (Index i = 0; i < points.rows(); ++i)
      values[i] = static_cast<float>(formula_(points.row(i).transpose().cast<double>()));
    count += points.rows();
  }
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override {
    evaluate(points, values);
    constexpr double step = 1e-6;
    for (Index i = 0; i < points.rows(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 x = points.row(i).transpose().cast<double>();
        x[axis] += step;
        const double above = formula_(x);
        x[axis] -= 2.0 * step;
        gradients(i, axis) = static_cast<float>((above - formula_(x)) / (2.0 * step));
      }
  }
  Frame frame() const override { return place; }
  std::optional<double> gradient_bound() const override { return bound; }
  double operator()(const Vec3& point) const { return formula_(point); }

  Frame place;
  std::optional<double> bound;
  mutable Index count = 0;

 private:
  Formula formula_;
};

inline double sphere_distance(const Vec3& x, const Vec3& center, double radius) {
  return (x - center).norm() - radius;
}

inline double box_distance(const Vec3& x, const Vec3& half) {
  const Vec3 q = x.cwiseAbs() - half;
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

inline Analytic sphere(double radius, const Vec3& center = Vec3::Zero()) {
  return Analytic([=](const Vec3& x) { return sphere_distance(x, center, radius); });
}

/// A ball with a fin whose two sides are 1e-4 apart, from which `point` is 3e-5 inside: a distance but where
/// fin and ball meet.
inline Analytic finned_ball(const Vec3& point, const Vec3& normal, double half_side) {
  const Vec3 along = normal.unitOrthogonal(), center = point + 2e-5 * normal + 0.3 * half_side * along;
  Mat3 turn;
  turn << along, normal.cross(along), normal;
  const Vec3 half(half_side, half_side, 5e-5);
  return Analytic([=](const Vec3& x) {
    return std::min(sphere_distance(x, Vec3(-0.2, -0.1, 0.0), 0.4),
                    box_distance(turn.transpose() * (x - center), half));
  });
}

inline Analytic box(const Vec3& half) {
  return Analytic([=](const Vec3& x) { return box_distance(x, half); });
}

/// About the z axis.
inline Analytic torus(double major, double minor) {
  return Analytic([=](const Vec3& x) { return std::hypot(std::hypot(x[0], x[1]) - major, x[2]) - minor; });
}

/// A ball with an overlapping box: creases, and no exact distance inside.
inline Analytic ball_and_box() {
  return Analytic([](const Vec3& x) {
    return std::min(sphere_distance(x, Vec3(-0.2, 0.1, 0.0), 0.45),
                    box_distance(x - Vec3(0.25, 0.0, 0.05), Vec3(0.4, 0.2, 0.3)));
  });
}

}  // namespace arapfields::shapes
