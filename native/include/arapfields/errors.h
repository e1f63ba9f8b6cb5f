// SPDX-License-Identifier: GPL-3.0-or-later
// What the library throws: InvalidInput, Cancelled, Diverged.
#pragma once

#include "core/errors.h"
#include "core/memory.h"
