// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/views.h"

#include <atomic>

#include "tensors/device.h"

namespace arapfields {
namespace {

std::atomic<int> scopes{0};

}  // namespace

bool on_device_path(const Tensor& tensor) { return !tensor.on_host() || scopes.load() > 0; }

DevicePathScope::DevicePathScope() { ++scopes; }
DevicePathScope::~DevicePathScope() { --scopes; }

Tensor upload(const Tensor& host, const Tensor& beside) {
  return beside.on_host() ? host.clone() : host.to_device_of(beside);
}

Tensor doubles_of(const Tensor& tensor) { return tensor.to_host().to(NumberType::float64).contiguous(); }

Points points_of(const Tensor& points) {
  const Tensor host = doubles_of(points);
  return Eigen::Map<const Points>(host.data<double>(), host.size(0), 3);
}

Vector vector_of(const Tensor& tensor) {
  const Tensor host = doubles_of(tensor);
  return Eigen::Map<const Vector>(host.data<double>(), host.count());
}

VectorF floats_of(const Tensor& tensor) {
  const Tensor host = tensor.to_host().to(NumberType::float32).contiguous();
  return Eigen::Map<const VectorF>(host.data<float>(), host.count());
}

}  // namespace arapfields
