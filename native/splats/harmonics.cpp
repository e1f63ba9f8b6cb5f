// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/harmonics.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace arapfields {
namespace {

constexpr int directions = 7;  // as many as the third band has functions
using Directions = Eigen::Matrix<double, 3, directions>;

/// Spread over a half sphere by the golden angle: an odd and an even band both tell them apart.
Directions spread() {
  Directions result;
  for (int i = 0; i < directions; ++i) {
    const double z = (i + 0.5) / directions, turn = std::numbers::pi * (3.0 - std::sqrt(5.0)) * i;
    const double radius = std::sqrt(1.0 - z * z);
    result.col(i) = Vec3(radius * std::cos(turn), radius * std::sin(turn), z);
  }
  return result;
}

/// (directions, 16): the functions in Rᵀ D.
Eigen::Matrix<double, directions, most_harmonics> functions(const Mat3& rotation, int count) {
  static const Directions where = spread();
  const Directions turned = rotation.transpose() * where;
  Eigen::Matrix<double, directions, most_harmonics> rows;
  for (int i = 0; i < directions; ++i) rows.row(i) = harmonics_at(turned.col(i), count);
  return rows;
}

template <int band>
void turn_band(const Eigen::Matrix<double, directions, most_harmonics>& turned, float* colours) {
  constexpr int first = band * band, count = 2 * band + 1;
  using Rows = Eigen::Matrix<double, directions, count>;
  static const Eigen::Matrix<double, count, directions> inverse = [] {
    const Rows rest = functions(Mat3::Identity(), most_harmonics).middleCols<count>(first);
    return Eigen::Matrix<double, count, directions>((rest.transpose() * rest).inverse() * rest.transpose());
  }();
  Eigen::Map<Eigen::Matrix<float, count, 3, Eigen::RowMajor>> rows(colours + 3 * first);
  const Eigen::Matrix<double, directions, 3> values =
      turned.middleCols<count>(first) * rows.template cast<double>();
  rows = (inverse * values).template cast<float>();
}

}  // namespace

Eigen::Matrix<double, most_harmonics, 1> harmonics_at(const Vec3& direction, int count) {
  Eigen::Matrix<double, most_harmonics, 1> y = Eigen::Matrix<double, most_harmonics, 1>::Zero();
  const double x = direction[0], v = direction[1], z = direction[2];
  const double xx = x * x, yy = v * v, zz = z * z, pi = std::numbers::pi;
  const double c1 = std::sqrt(3.0 / (4.0 * pi)), c2 = std::sqrt(15.0 / pi), c3 = std::sqrt(35.0 / (2.0 * pi));
  const double c4 = std::sqrt(21.0 / (2.0 * pi)), c5 = std::sqrt(105.0 / pi);
  y[0] = std::sqrt(1.0 / (4.0 * pi));
  if (count > 1) y.segment<3>(1) << -c1 * v, c1 * z, -c1 * x;
  if (count > 4)
    y.segment<5>(4) << 0.5 * c2 * x * v, -0.5 * c2 * v * z, 0.25 * std::sqrt(5.0 / pi) * (2.0 * zz - xx - yy),
        -0.5 * c2 * x * z, 0.25 * c2 * (xx - yy);
  if (count > 9)
    y.segment<7>(9) << -0.25 * c3 * v * (3.0 * xx - yy), 0.5 * c5 * x * v * z,
        -0.25 * c4 * v * (4.0 * zz - xx - yy), 0.25 * std::sqrt(7.0 / pi) * z * (2.0 * zz - 3.0 * (xx + yy)),
        -0.25 * c4 * x * (4.0 * zz - xx - yy), 0.25 * c5 * z * (xx - yy), -0.25 * c3 * x * (xx - 3.0 * yy);
  return y;
}

void turn_harmonics(const Mat3& rotation, Eigen::Ref<Eigen::RowVectorXf> colours) {
  const int count = static_cast<int>(colours.size()) / 3;
  if (count < 4) return;
  const auto turned = functions(rotation, count);
  turn_band<1>(turned, colours.data());
  if (count > 4) turn_band<2>(turned, colours.data());
  if (count > 9) turn_band<3>(turned, colours.data());
}

}  // namespace arapfields
