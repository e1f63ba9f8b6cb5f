// SPDX-License-Identifier: GPL-3.0-or-later
// Cancel and progress of long calls, and how many threads they use.
#pragma once

#include "core/parallel.h"
#include "core/task.h"
