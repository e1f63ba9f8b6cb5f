// SPDX-License-Identifier: GPL-3.0-or-later
#include <ATen/Parallel.h>

#include "core/library_threads.h"

// Of the OpenMP library that libtorch itself uses: per thread, as the standard says.
extern "C" int omp_get_max_threads();
extern "C" void omp_set_num_threads(int count);
#if defined(__linux__) && defined(__x86_64__)
// Exported by a libtorch that is built with MKL; returns the setting before, 0 for "as the process".
extern "C" __attribute__((weak)) int MKL_Set_Num_Threads_Local(int count);
#endif

namespace arapfields {
namespace {

int set_mkl_threads([[maybe_unused]] int count) {
#if defined(__linux__) && defined(__x86_64__)
  return MKL_Set_Num_Threads_Local != nullptr ? MKL_Set_Num_Threads_Local(count) : 0;
#else
  return 0;
#endif
}

}  // namespace

// The first question about its threads that a thread asks libtorch sets them: it is asked before we do.
int library_threads() { return at::get_num_threads(); }

SerialLibrary::SerialLibrary() : openmp_(library_threads()), mkl_(set_mkl_threads(1)) {
  omp_set_num_threads(1);
}

SerialLibrary::~SerialLibrary() {
  omp_set_num_threads(openmp_);
  set_mkl_threads(mkl_);
}

void keep_library_serial() {
  library_threads();
  set_mkl_threads(1);
  omp_set_num_threads(1);
}

}  // namespace arapfields
