// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace at {
class Tensor;
}

namespace arapfields {

/// Whether a tensor is worked on by compositions of libtorch's operations rather than by our kernels: always
/// where it is not in main memory, and everywhere while a AtenPathScope lives.
bool on_aten_path(const at::Tensor& tensor);

/// Forces compositions on tensors in main memory too, in the whole process: what a device would compute can
/// then be compared with the kernels where there is none.
class AtenPathScope {
 public:
  AtenPathScope();
  ~AtenPathScope();
  AtenPathScope(const AtenPathScope&) = delete;
  AtenPathScope& operator=(const AtenPathScope&) = delete;
};

/// "auto" → the best device there is; throws InvalidInput for a name that is unknown or not there.
std::string resolve_device(const std::string& device);
/// Whether a CUDA device was found, and why not.
std::string device_report();

/// A copy of a tensor in main memory, of its dtype, on the device of `beside`. Does not wait for the device:
/// the way there leads through page-locked memory.
at::Tensor upload(const at::Tensor& host, const at::Tensor& beside);

}  // namespace arapfields
