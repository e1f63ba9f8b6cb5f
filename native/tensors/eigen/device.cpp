// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/device.h"

namespace arapfields {

std::string backend_name() { return "eigen"; }

bool has_cuda() { return false; }

std::string device_report() { return "no CUDA device: this build has no libtorch"; }

}  // namespace arapfields
