// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/device.h"

#include <ATen/ATen.h>
#include <ATen/Context.h>

#include <atomic>

#include "core/errors.h"

namespace arapfields {
namespace {

std::atomic<int> scopes{0};

}  // namespace

bool on_aten_path(const at::Tensor& tensor) { return !tensor.is_cpu() || scopes.load() > 0; }

AtenPathScope::AtenPathScope() { ++scopes; }
AtenPathScope::~AtenPathScope() { --scopes; }

std::string device_report() {
  if (at::hasCUDA()) return "a CUDA device was found";
  return at::detail::getCUDAHooks().hasCUDART()
             ? "no CUDA device: libtorch has CUDA, but neither a device nor its driver answers"
             : "no CUDA device: the libtorch here is the processor's build";
}

std::string resolve_device(const std::string& device) {
  const bool cuda = at::hasCUDA();
  if (device == "auto") return cuda ? "cuda" : "cpu";
  require(device == "cpu" || device.rfind("cuda", 0) == 0, "device", "'" + device + "'",
          "'auto', 'cpu' or 'cuda' is allowed");
  require(device == "cpu" || cuda, "device", "'" + device + "'", device_report());
  return device;
}

at::Tensor upload(const at::Tensor& host, const at::Tensor& beside) {
  if (beside.is_cpu()) return host.clone(at::MemoryFormat::Contiguous);
  return host.pin_memory().to(beside.device(), true);
}

}  // namespace arapfields
