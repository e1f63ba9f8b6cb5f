// SPDX-License-Identifier: GPL-3.0-or-later
// One surface onto another: wrap, WrapSequence, suggest_landmarks, Correspondence.
#pragma once

#include "wrap/sequence.h"
#include "wrap/suggestion.h"
#include "wrap/transfer.h"
#include "wrap/wrap.h"
