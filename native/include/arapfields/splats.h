// SPDX-License-Identifier: GPL-3.0-or-later
// Gaussian splats: moved by a field, sampled, read and written.
#pragma once

#include "io/splat_file.h"
#include "io/splat_gltf.h"
#include "splats/gaussian_splats.h"
#include "splats/move_splats.h"
#include "splats/sample_splats.h"
