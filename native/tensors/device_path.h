// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/export.h"

namespace arapfields {

class Tensor;

/// Whether a tensor is worked on by compositions of tensor operations rather than by our kernels: always
/// where it is not in main memory, and everywhere while a DevicePathScope lives.
bool on_device_path(const Tensor& tensor);

/// Forces compositions on tensors in main memory too, in the whole process: what a device would compute can
/// then be compared with the kernels where there is none.
class ARAPFIELDS_EXPORT_TO_TESTS DevicePathScope {
 public:
  DevicePathScope();
  ~DevicePathScope();
  DevicePathScope(const DevicePathScope&) = delete;
  DevicePathScope& operator=(const DevicePathScope&) = delete;
};

}  // namespace arapfields
