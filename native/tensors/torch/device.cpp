// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

#include <ATen/ATen.h>
#include <ATen/Context.h>

namespace arapfields {

std::string backend_name() { return "torch"; }

bool has_cuda() { return at::hasCUDA(); }

std::string device_report() {
  if (at::hasCUDA()) return "a CUDA device was found";
  return at::detail::getCUDAHooks().hasCUDART()
             ? "no CUDA device: libtorch has CUDA, but neither a device nor its driver answers"
             : "no CUDA device: the libtorch here is the processor's build";
}

}  // namespace arapfields
