// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/adjoint_kernels.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

// V is a pack, or one number for the units that are left over.
template <class V, class Scalar>
inline V read(const Scalar* from) {
  V value;
  __builtin_memcpy(&value, from, sizeof value);
  return value;
}

template <class V, class Scalar>
inline void write(Scalar* to, V value) {
  __builtin_memcpy(to, &value, sizeof value);
}

/// One point, units w to w + (size of V) of the outputs first to first + count.
template <class V, int count, class Scalar>
inline void adjoint_units(const AdjointBlock<Scalar>& b, std::int64_t p, std::int64_t w, int first,
                          V (&sum)[count][6]) {
  const std::int64_t plane = b.points * b.width, at = p * b.width + w;
  const V s = read<V>(b.slope + at), curve = b.sharpness * s * (1 - s);
  const V z1 = read<V>(b.activations + plane + at), z2 = read<V>(b.activations + 2 * plane + at),
          z3 = read<V>(b.activations + 3 * plane + at);
  const V c1 = curve * z1, c2 = curve * z2, c3 = curve * z3;
  const V bent[6] = {c1 * z1, c2 * z2, c3 * z3, c1 * z2, c1 * z3, c2 * z3};
  for (int o = 0; o < count; ++o) {
    const V q = read<V>(b.adjoints + (first + o) * (b.shared ? b.width : plane) + (b.shared ? w : at));
    write(b.below + (first + o) * plane + at, V(s * q));
    for (int c = 0; c < 6; ++c) sum[o][c] += q * bent[c];
  }
}

template <int count, class Scalar>
void adjoint_outputs(const AdjointBlock<Scalar>& b, int first, Scalar* second) {
  for (std::int64_t p = 0; p < b.points; ++p) {
    Pack<Scalar> wide[count][6] = {};
    Scalar rest[count][6] = {};
    std::int64_t w = 0;
    for (; w + lanes<Scalar> <= b.width; w += lanes<Scalar>) adjoint_units(b, p, w, first, wide);
    for (; w < b.width; ++w) adjoint_units(b, p, w, first, rest);
    for (int c = 0; c < 6; ++c)
      for (int o = 0; o < count; ++o)
        second[(p * 6 + c) * b.outputs + first + o] += sum_of_lanes<Scalar>(wide[o][c]) + rest[o][c];
  }
}

/// `d`: the cotangents (6, outputs) of this point's second derivatives.
template <class V, class Scalar>
inline void back_units(const AdjointBlock<Scalar>& b, std::int64_t p, std::int64_t w, const Scalar* d,
                       Scalar* cotangents, Scalar* partial) {
  const std::int64_t plane = b.points * b.width, at = p * b.width + w;
  const V s = read<V>(b.slope + at), curve = b.sharpness * s * (1 - s);
  const V steeper = b.sharpness * (1 - 2 * s);  // φ''' = steeper φ''
  const V z1 = read<V>(b.activations + plane + at), z2 = read<V>(b.activations + 2 * plane + at),
          z3 = read<V>(b.activations + 3 * plane + at);
  V to_value = {}, to_1 = {}, to_2 = {}, to_3 = {};
  for (int o = 0; o < b.outputs; ++o) {
    const Scalar d11 = d[o], d22 = d[b.outputs + o], d33 = d[2 * b.outputs + o];
    const Scalar d12 = d[3 * b.outputs + o], d13 = d[4 * b.outputs + o], d23 = d[5 * b.outputs + o];
    const V q = read<V>(b.adjoints + o * (b.shared ? b.width : plane) + (b.shared ? w : at));
    const V g = read<V>(cotangents + o * plane + at);
    // m_i = Σ_j ĥ_ij ∂_j z, the diagonal twice; then Σ_{i≤j} ĥ_ij ∂_i z ∂_j z = ½ Σ_i ∂_i z m_i.
    const V m1 = 2 * d11 * z1 + d12 * z2 + d13 * z3;
    const V m2 = d12 * z1 + 2 * d22 * z2 + d23 * z3;
    const V m3 = d13 * z1 + d23 * z2 + 2 * d33 * z3;
    const V bent = Scalar(0.5) * (z1 * m1 + z2 * m2 + z3 * m3);
    to_value += q * (g + steeper * bent);
    to_1 += q * m1, to_2 += q * m2, to_3 += q * m3;
    write(cotangents + o * plane + at, V(s * g + curve * bent));
    write(b.below + o * plane + at, V(s * q));
  }
  write(partial + at, V(curve * to_value));
  write(partial + plane + at, V(curve * to_1));
  write(partial + 2 * plane + at, V(curve * to_2));
  write(partial + 3 * plane + at, V(curve * to_3));
}

}  // namespace

template <class Scalar>
void adjoint(const AdjointBlock<Scalar>& b, Scalar* second) {
  if (b.outputs == 3) return adjoint_outputs<3>(b, 0, second);
  for (int o = 0; o < b.outputs; ++o) adjoint_outputs<1>(b, o, second);
}
template void adjoint(const AdjointBlock<float>&, float*);
template void adjoint(const AdjointBlock<double>&, double*);

template <class Scalar>
void adjoint_back(const AdjointBlock<Scalar>& b, const Scalar* second, Scalar* cotangents, Scalar* partial) {
  for (std::int64_t p = 0; p < b.points; ++p) {
    const Scalar* d = second + p * 6 * b.outputs;
    std::int64_t w = 0;
    for (; w + lanes<Scalar> <= b.width; w += lanes<Scalar>)
      back_units<Pack<Scalar>>(b, p, w, d, cotangents, partial);
    for (; w < b.width; ++w) back_units<Scalar>(b, p, w, d, cotangents, partial);
  }
}
template void adjoint_back(const AdjointBlock<float>&, const float*, float*, float*);
template void adjoint_back(const AdjointBlock<double>&, const double*, double*, double*);

}  // namespace arapfields::SIMD_LEVEL
