// SPDX-License-Identifier: GPL-3.0-or-later
// Gauss stylization: stylize.
#pragma once

#include "energies/object_style.h"
#include "energies/styles.h"
#include "solve/stylize.h"
