// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces as meshes: extract_surface, extract_deformed.
#pragma once

#include "extraction/extract_deformed.h"
#include "extraction/extract_surface.h"
