// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/export.h"

namespace arapfields {

/// Bytes that this process can still get: what the system has to spare, and what its control group allows.
/// Infinity where the system does not say.
ARAPFIELDS_EXPORT double available_memory();

/// Throws InvalidInput before `bytes` are asked for that the machine does not have, rather than be killed
/// halfway. `argument` is what to make smaller.
ARAPFIELDS_EXPORT void require_memory(const std::string& argument, double bytes);

}  // namespace arapfields
