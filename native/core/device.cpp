// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/device.h"

#include <ATen/ATen.h>
#include <ATen/Context.h>

#include "core/errors.h"

namespace arapfields {

std::string device_report() {
  if (at::hasCUDA()) return "a CUDA device was found";
  return at::detail::getCUDAHooks().hasCUDART()
             ? "no CUDA device: libtorch has CUDA, but neither a device nor its driver answers"
             : "no CUDA device: the libtorch here is the processor's build";
}

std::string resolve_device(const std::string& device) {
  if (device == "auto") return "cpu";  // CUDA is experimental: who wants it names it
  const bool cuda = at::hasCUDA();
  require(device == "cpu" || device.rfind("cuda", 0) == 0, "device", "'" + device + "'",
          "'auto', 'cpu' or 'cuda' is allowed");
  require(device == "cpu" || cuda, "device", "'" + device + "'", device_report());
  return device;
}

}  // namespace arapfields
