// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/harmonics.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace arapfields {
namespace {

template <int band, class Scalar>
void invert_band(const double (&directions)[harmonic_directions][3],
                 Scalar (&out)[band_size(band)][harmonic_directions]) {
  Eigen::Matrix<double, harmonic_directions, band_size(band), Eigen::RowMajor> functions;
  for (int i = 0; i < harmonic_directions; ++i)
    harmonics_in<band, double>(directions[i], functions.row(i).data());
  const auto normal = (functions.transpose() * functions).eval();
  Eigen::Map<Eigen::Matrix<Scalar, band_size(band), harmonic_directions, Eigen::RowMajor>> inverse(out[0]);
  inverse = (normal.inverse() * functions.transpose()).template cast<Scalar>();
}

template <class Scalar>
HarmonicTables<Scalar> made() {
  HarmonicTables<Scalar> tables;
  double directions[harmonic_directions][3];
  for (int i = 0; i < harmonic_directions; ++i) {  // over a half sphere, by the golden angle
    const double z = (i + 0.5) / harmonic_directions, radius = std::sqrt(1.0 - z * z);
    const double turn = std::numbers::pi * (3.0 - std::sqrt(5.0)) * i;
    const double direction[3] = {radius * std::cos(turn), radius * std::sin(turn), z};
    for (int k = 0; k < 3; ++k) {
      directions[i][k] = direction[k];
      tables.directions[i][k] = static_cast<Scalar>(direction[k]);
    }
  }
  invert_band<2>(directions, tables.second);
  invert_band<3>(directions, tables.third);
  return tables;
}

}  // namespace

template <class Scalar>
const HarmonicTables<Scalar>& harmonic_tables() {
  static const HarmonicTables<Scalar> tables = made<Scalar>();
  return tables;
}
template const HarmonicTables<float>& harmonic_tables();
template const HarmonicTables<double>& harmonic_tables();

}  // namespace arapfields
