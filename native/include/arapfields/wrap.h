// SPDX-License-Identifier: GPL-3.0-or-later
// One surface onto another: wrap.
#pragma once

#include "wrap/wrap.h"
