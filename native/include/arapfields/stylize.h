// SPDX-License-Identifier: GPL-3.0-or-later
// Gauss stylization: stylize, sharpen, folded_triangles.
#pragma once

#include "energies/object_style.h"
#include "energies/styles.h"
#include "sharpen/folded_triangles.h"
#include "sharpen/sharpen.h"
#include "solve/stylize.h"
