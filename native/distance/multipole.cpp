// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/multipole.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace arapfields {
namespace {

/// Adds `part`, moved to the center of `sum`.
void add_shifted(const Multipole& part, Multipole& sum) {
  const Vec3 s = part.center - sum.center;
  sum.radius = std::max(sum.radius, s.norm() + part.radius);
  sum.dipole += part.dipole;
  sum.quadrupole += part.quadrupole + s * part.dipole.transpose();
  for (int k = 0; k < 3; ++k) {
    const Vec3 q = part.quadrupole.col(k);
    sum.octupole[k] +=
        part.octupole[k] + s * q.transpose() + q * s.transpose() + s * s.transpose() * part.dipole[k];
  }
}

}  // namespace

Multipole multipole_of(const Vec3* corners, int triangle_count) {
  Multipole sum;
  Vec3 plain_mean = Vec3::Zero();
  for (int t = 0; t < triangle_count; ++t) {
    const Vec3 *v = corners + 3 * t, centroid = (v[0] + v[1] + v[2]) / 3.0;
    const double area = 0.5 * (v[1] - v[0]).cross(v[2] - v[0]).norm();
    sum.area += area;
    sum.center += area * centroid;
    plain_mean += centroid / triangle_count;
  }
  sum.center = sum.area > 0.0 ? Vec3(sum.center / sum.area) : plain_mean;
  for (int t = 0; t < triangle_count; ++t) {
    const Vec3 *v = corners + 3 * t, centroid = (v[0] + v[1] + v[2]) / 3.0;
    const Vec3 area_normal = 0.5 * (v[1] - v[0]).cross(v[2] - v[0]);
    const Vec3 g = centroid - sum.center;
    // Second moments of a triangle about its centroid: A/12 Σ (v − centroid)(v − centroid)ᵀ.
    Mat3 second = g * g.transpose();
    for (int k = 0; k < 3; ++k) {
      const Vec3 d = v[k] - centroid;
      second += d * d.transpose() / 12.0;
      sum.radius = std::max(sum.radius, (v[k] - sum.center).norm());
    }
    sum.dipole += area_normal;
    sum.quadrupole += g * area_normal.transpose();
    for (int k = 0; k < 3; ++k) sum.octupole[k] += second * area_normal[k];
  }
  return sum;
}

Multipole multipole_of(const Multipole* parts, int count) {
  Multipole sum;
  Vec3 plain_mean = Vec3::Zero();
  for (int i = 0; i < count; ++i) {
    sum.area += parts[i].area;
    sum.center += parts[i].area * parts[i].center;
    plain_mean += parts[i].center / count;
  }
  sum.center = sum.area > 0.0 ? Vec3(sum.center / sum.area) : plain_mean;
  for (int i = 0; i < count; ++i) add_shifted(parts[i], sum);
  return sum;
}

void store(const Multipole& m, NodeMoments& moments, int lane) {
  constexpr double solid = 1.0 / (4.0 * std::numbers::pi);
  for (int k = 0; k < 3; ++k) moments.center[k][lane] = static_cast<float>(m.center[k]);
  const double radius = m.radius * (1.0 + 1e-6);  // the center moved when it was rounded
  moments.radius_squared[lane] = static_cast<float>(radius * radius);
  moments.area[lane] = static_cast<float>(solid * m.area);
  for (int k = 0; k < 3; ++k) moments.dipole[k][lane] = static_cast<float>(solid * m.dipole[k]);

  // −3 (sym Q − tr Q / 3 I)
  Mat3 q = 0.5 * (m.quadrupole + m.quadrupole.transpose());
  q -= q.trace() / 3.0 * Mat3::Identity();
  const double quadrupole[5] = {q(0, 0), q(1, 1), 2 * q(0, 1), 2 * q(0, 2), 2 * q(1, 2)};
  for (int k = 0; k < 5; ++k) moments.quadrupole[k][lane] = static_cast<float>(-3.0 * solid * quadrupole[k]);

  // 15/2 (sym T − 3/5 sym(δ t)), t_i = Σ_j (sym T)_ijj
  const auto sym = [&](int i, int j, int k) {
    return (m.octupole[k](i, j) + m.octupole[j](i, k) + m.octupole[i](j, k)) / 3.0;
  };
  Vec3 trace;
  for (int i = 0; i < 3; ++i) trace[i] = sym(i, 0, 0) + sym(i, 1, 1) + sym(i, 2, 2);
  const auto s = [&](int i, int j, int k) {
    return sym(i, j, k) -
           0.2 * ((i == j ? trace[k] : 0.0) + (i == k ? trace[j] : 0.0) + (j == k ? trace[i] : 0.0));
  };
  const double octupole[7] = {s(0, 0, 0), s(1, 1, 1), 3 * s(0, 0, 1), 3 * s(0, 1, 1),
                              s(0, 0, 2), s(1, 1, 2), 6 * s(0, 1, 2)};
  for (int k = 0; k < 7; ++k) moments.octupole[k][lane] = static_cast<float>(7.5 * solid * octupole[k]);
}

void store_nothing(NodeMoments& moments, int lane) {
  store(Multipole{}, moments, lane);
  moments.center[0][lane] = 1e3f;  // away from every query, so that nothing is divided by zero
  moments.radius_squared[lane] = -1.0f;
}

}  // namespace arapfields
