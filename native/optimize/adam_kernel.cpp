// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/adam_kernel.h"

#include <cmath>

namespace arapfields::SIMD_LEVEL {
template <class Scalar>
void adam(const AdamBlock<Scalar>& b) {
  const Scalar d1 = b.beta1, d2 = b.beta2, rate = b.rate, scale = b.scale, epsilon = b.epsilon;
  Scalar *x = b.parameters, *m = b.mean, *v = b.square;
  const Scalar* g = b.gradient;
#pragma GCC ivdep
  for (std::int64_t i = 0; i < b.count; ++i) {
    const Scalar mean = d1 * m[i] + (1 - d1) * g[i];
    const Scalar square = d2 * v[i] + (1 - d2) * g[i] * g[i];
    m[i] = mean;
    v[i] = square;
    x[i] -= rate * mean / (std::sqrt(square) * scale + epsilon);
  }
}
template void adam(const AdamBlock<float>&);
template void adam(const AdamBlock<double>&);

}  // namespace arapfields::SIMD_LEVEL
