// SPDX-License-Identifier: GPL-3.0-or-later
// Weights of bones from poses, and skinning with them.
#pragma once

#include "skin/correctives.h"
#include "skin/rig_shape.h"
#include "skin/skin_weights.h"
#include "skin/skinning.h"
