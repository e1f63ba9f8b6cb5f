// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/export.h"

namespace arapfields {

/// Instruction sets for which kernels are compiled (SIMD sources of CMake). A kernel file defines its
/// functions in the namespace arapfields::SIMD_LEVEL; a plain source picks one by simd_level().
enum class SimdLevel { baseline, neon, avx2, avx512 };

/// The best level of this processor: neon on every 64-bit ARM one, the others on x86.
/// ARAPFIELDS_SIMD=baseline|neon|avx2|avx512 in the environment lowers it.
ARAPFIELDS_EXPORT SimdLevel simd_level();
ARAPFIELDS_EXPORT const char* simd_level_name();

}  // namespace arapfields
