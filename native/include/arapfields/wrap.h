// SPDX-License-Identifier: GPL-3.0-or-later
// One surface onto another: wrap, suggest_landmarks, Correspondence.
#pragma once

#include "wrap/suggestion.h"
#include "wrap/transfer.h"
#include "wrap/wrap.h"
