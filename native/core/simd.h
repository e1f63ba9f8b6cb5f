// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/simd_level.h"

/// Calls function(...) in the namespace of the level at hand.
#if defined(__x86_64__) || defined(_M_X64)
#define ARAPFIELDS_DISPATCH(call)                                 \
  (::arapfields::simd_level() == SimdLevel::avx512 ? avx512::call \
   : ::arapfields::simd_level() == SimdLevel::avx2 ? avx2::call   \
                                                   : baseline::call)
/// Declares `declaration;` in every level's namespace (use inside namespace arapfields).
#define ARAPFIELDS_DECLARE(declaration) \
  namespace baseline {                  \
  declaration;                          \
  }                                     \
  namespace avx2 {                      \
  declaration;                          \
  }                                     \
  namespace avx512 {                    \
  declaration;                          \
  }
#elif defined(__aarch64__) && defined(__APPLE__)  // nothing to choose: all of these have NEON
#define ARAPFIELDS_DISPATCH(call) neon::call
#define ARAPFIELDS_DECLARE(declaration) \
  namespace neon {                      \
  declaration;                          \
  }
#elif defined(__aarch64__)
#define ARAPFIELDS_DISPATCH(call) \
  (::arapfields::simd_level() == SimdLevel::neon ? neon::call : baseline::call)
#define ARAPFIELDS_DECLARE(declaration) \
  namespace baseline {                  \
  declaration;                          \
  }                                     \
  namespace neon {                      \
  declaration;                          \
  }
#else
#define ARAPFIELDS_DISPATCH(call) baseline::call
#define ARAPFIELDS_DECLARE(declaration) \
  namespace baseline {                  \
  declaration;                          \
  }
#endif
