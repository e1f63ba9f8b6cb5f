// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

#include <algorithm>
#include <cstdlib>
#include <thread>

#include "core/parallel.h"

namespace arapfields {

std::string backend_name() { return "eigen"; }

int cuda_devices() { return 0; }

std::string device_report() { return "no CUDA device: this build has no libtorch"; }

std::optional<BackendError> backend_error(const std::exception&) { return std::nullopt; }

namespace {

/// Eigen starts no threads: there is nothing to keep serial, but the number must be seen as libtorch's is.
thread_local bool serial = false;

int number_of_threads() {
  const char* const set = std::getenv("OMP_NUM_THREADS");
  const int wanted = set != nullptr ? std::atoi(set) : 0;
  return wanted > 0 ? wanted : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace

int library_threads() {
  static const int threads = number_of_threads();
  return serial ? 1 : threads;
}

SerialLibrary::SerialLibrary() : openmp_(serial), mkl_(0) { serial = true; }
SerialLibrary::~SerialLibrary() {
  static_cast<void>(mkl_);  // which only libtorch brings along
  serial = openmp_ != 0;
}

void keep_library_serial() { serial = true; }

}  // namespace arapfields
