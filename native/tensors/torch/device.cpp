// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

#include <ATen/ATen.h>
#include <ATen/Context.h>
#include <c10/core/CachingDeviceAllocator.h>

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

}  // namespace arapfields
