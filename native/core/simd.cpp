// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/simd.h"

#include <algorithm>
#include <cstdlib>
#include <string>

namespace arapfields {

ARAPFIELDS_DECLARE(const char* compiled_for())

namespace {

SimdLevel detect() {
  SimdLevel level = SimdLevel::baseline;
#if (defined(__x86_64__) || defined(_M_X64)) && (defined(__GNUC__) || defined(__clang__))
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) level = SimdLevel::avx2;
  if (level == SimdLevel::avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    level = SimdLevel::avx512;
#elif defined(__aarch64__)
  level = SimdLevel::neon;  // part of the architecture
#endif
  const char* requested = std::getenv("ARAPFIELDS_SIMD");
  if (requested == nullptr) return level;
  const std::string name = requested;
#ifndef __APPLE__
  if (name == "baseline") return SimdLevel::baseline;
#endif
  if (name == "avx2") return std::min(level, SimdLevel::avx2);
  return level;
}

}  // namespace

SimdLevel simd_level() {
  static const SimdLevel level = detect();
  return level;
}

const char* simd_level_name() { return ARAPFIELDS_DISPATCH(compiled_for()); }

}  // namespace arapfields
