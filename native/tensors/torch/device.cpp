// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

#include <ATen/ATen.h>
#include <ATen/Context.h>
#include <ATen/Parallel.h>
#include <c10/core/CachingDeviceAllocator.h>

#include "core/parallel.h"

extern "C" int omp_get_max_threads();
extern "C" void omp_set_num_threads(int count);
#if defined(__linux__) && defined(__x86_64__)
extern "C" __attribute__((weak)) int MKL_Set_Num_Threads_Local(int count);
#endif

namespace arapfields {

std::string backend_name() { return "torch"; }

int cuda_devices() { return at::hasCUDA() ? static_cast<int>(at::getNumGPUs()) : 0; }

std::string device_report() {
  if (at::hasCUDA()) return "a CUDA device was found";
  return at::detail::getCUDAHooks().hasCUDART()
             ? "no CUDA device: libtorch has CUDA, but neither a device nor its driver answers"
             : "no CUDA device: the libtorch here is the processor's build";
}

std::optional<BackendError> backend_error(const std::exception& error) {
  const auto* const raised = dynamic_cast<const c10::Error*>(&error);
  if (!raised) return std::nullopt;
  const std::string text = raised->what_without_backtrace();
  if (!dynamic_cast<const c10::OutOfMemoryError*>(raised)) return BackendError{text, false};
  if (at::hasCUDA()) c10::getDeviceAllocator(at::kCUDA)->emptyCache();
  return BackendError{text.substr(0, text.find(". Including non-PyTorch memory")), true};
}

// Of the OpenMP library that libtorch itself uses: per thread, as the standard says.
// Exported by a libtorch that is built with MKL; returns the setting before, 0 for "as the process".

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
