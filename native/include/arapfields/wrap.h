// SPDX-License-Identifier: GPL-3.0-or-later
// One surface onto another: wrap, Correspondence.
#pragma once

#include "wrap/transfer.h"
#include "wrap/wrap.h"
