// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

namespace arapfields {

std::string backend_name() { return "eigen"; }

int cuda_devices() { return 0; }

std::string device_report() { return "no CUDA device: this build has no libtorch"; }

std::optional<BackendError> backend_error(const std::exception&) { return std::nullopt; }

}  // namespace arapfields
