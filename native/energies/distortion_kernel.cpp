// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/pack_points.h"
#include "energies/kernels.h"
#include "energies/rotation_pack.h"

namespace arapfields::SIMD_LEVEL {
/// Signed singular values from K's eigenvalues, their pairwise sums; the smallest has the sign of det J.
template <class Scalar>
void distortion_range(const Scalar* jets, std::int64_t count, std::int64_t begin, std::int64_t end,
                      double* out) {
  for (std::int64_t point = begin; point < end; point += lanes<Scalar>) {
    const std::int64_t valid = end - point;
    Pack33<Scalar> jacobian;
    load_jacobians(jets + 3 * count, count, point, valid, jacobian);
    RotationPack<Scalar> polar;
    closest_rotation<Scalar>(jacobian, polar);
    const Pack<Scalar> total = Scalar(0.5) * (polar.sums[0] + polar.sums[1] + polar.sums[2]);
    Pack3<Scalar> sigma;
    for (int c = 0; c < 3; ++c) sigma[c] = total - polar.sums[c];
    for (int lane = 0; lane < lanes<Scalar> && lane < valid; ++lane) {
      double determinant = 1.0, high = 0.0, low = INFINITY;
      for (int c = 0; c < 3; ++c) {
        const double value = static_cast<double>(sigma[c][lane]), size = std::abs(value);
        determinant *= value;
        high = size > high ? size : high;
        low = size < low ? size : low;
      }
      out[0] = determinant < out[0] ? determinant : out[0];
      out[1] += determinant > 0.0 ? 0.0 : 1.0;
      out[2] = high > out[2] ? high : out[2];
      out[3] = low < out[3] ? low : out[3];
    }
  }
}
template void distortion_range(const float*, std::int64_t, std::int64_t, std::int64_t, double*);
template void distortion_range(const double*, std::int64_t, std::int64_t, std::int64_t, double*);

}  // namespace arapfields::SIMD_LEVEL
