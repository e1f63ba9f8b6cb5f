// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <exception>
#include <optional>
#include <string>

#include "core/export.h"

namespace arapfields {

/// "auto" → "cpu"; throws InvalidInput for a name that is unknown or
/// not available.
ARAPFIELDS_EXPORT std::string resolve_device(const std::string& device);
/// Whether a CUDA device was found, and why not.
ARAPFIELDS_EXPORT std::string device_report();
/// What does the library's products: "torch" or "eigen" (ARAPFIELDS_BACKEND).
ARAPFIELDS_EXPORT std::string backend_name();

int cuda_devices();

struct BackendError {
  std::string text;
  bool out_of_memory;
};
/// An error that the backend raised, without its list of C++ calls; none if it is another's. Once memory has
/// run out, a device gets back what the backend keeps of it for later.
ARAPFIELDS_EXPORT std::optional<BackendError> backend_error(const std::exception& error);

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
