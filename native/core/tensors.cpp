// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/tensors.h"

#include <atomic>

#include "core/aten_path.h"

namespace arapfields {
namespace {

std::atomic<int> scopes{0};

at::Tensor doubles(const at::Tensor& tensor) { return tensor.to(at::kCPU, at::kDouble).contiguous(); }

}  // namespace

bool on_aten_path(const at::Tensor& tensor) { return !tensor.is_cpu() || scopes.load() > 0; }

AtenPathScope::AtenPathScope() { ++scopes; }
AtenPathScope::~AtenPathScope() { --scopes; }

at::Tensor upload(const at::Tensor& host, const at::Tensor& beside) {
  if (beside.is_cpu()) return host.clone(at::MemoryFormat::Contiguous);
  return host.pin_memory().to(beside.device(), true);
}

Points points_of(const at::Tensor& points) {
  const at::Tensor host = doubles(points);
  return Eigen::Map<const Points>(host.const_data_ptr<double>(), host.size(0), 3);
}

Vector vector_of(const at::Tensor& tensor) {
  const at::Tensor host = doubles(tensor);
  return Eigen::Map<const Vector>(host.const_data_ptr<double>(), host.numel());
}

}  // namespace arapfields
