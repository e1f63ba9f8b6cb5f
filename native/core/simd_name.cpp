// SPDX-License-Identifier: GPL-3.0-or-later
// The smallest kernel: says for which instruction set the kernels picked by dispatch were compiled.
namespace arapfields::SIMD_LEVEL {

const char* compiled_for() {
#if defined(__AVX512F__)
  return "avx512";
#elif defined(__AVX2__)
  return "avx2";
#elif defined(ARAPFIELDS_NEON)
  return "neon";
#else
  return "baseline";
#endif
}

}  // namespace arapfields::SIMD_LEVEL
