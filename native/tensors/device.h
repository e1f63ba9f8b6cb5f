// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/export.h"

namespace arapfields {

/// "auto" → "cpu", as long as CUDA is experimental; throws InvalidInput for a name that is unknown or
/// not available.
ARAPFIELDS_EXPORT std::string resolve_device(const std::string& device);
/// Whether a CUDA device was found, and why not.
ARAPFIELDS_EXPORT std::string device_report();
/// What does the library's products: "torch" or "eigen" (ARAPFIELDS_BACKEND).
ARAPFIELDS_EXPORT std::string backend_name();

bool has_cuda();

}  // namespace arapfields
