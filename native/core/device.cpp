// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/device.h"

#include <ATen/ATen.h>

#include <atomic>

namespace arapfields {
namespace {

std::atomic<int> scopes{0};

}  // namespace

bool composed(const at::Tensor& tensor) { return !tensor.is_cpu() || scopes.load() > 0; }

ComposedScope::ComposedScope() { ++scopes; }
ComposedScope::~ComposedScope() { --scopes; }

at::Tensor upload(const at::Tensor& host, const at::Tensor& beside) {
  if (beside.is_cpu()) return host.clone(at::MemoryFormat::Contiguous);
  return host.pin_memory().to(beside.device(), true);
}

}  // namespace arapfields
