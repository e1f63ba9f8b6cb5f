// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "core/export.h"

namespace arapfields {

/// Bytes that this process can still allocate, by the system's free memory and the limits of its control
/// group. Infinity where the system does not report them.
ARAPFIELDS_EXPORT double available_memory();

/// Throws InvalidInput where `bytes` exceed the free memory, so that the process is not killed halfway.
/// `argument` names what to reduce.
ARAPFIELDS_EXPORT void require_memory(const std::string& argument, double bytes);

}  // namespace arapfields
