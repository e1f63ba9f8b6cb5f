// SPDX-License-Identifier: GPL-3.0-or-later
// Triangle meshes, and samples uniform by area: validate, sample_mesh, sample_meshes.
#pragma once

#include "mesh/sample_mesh.h"
#include "mesh/surface_samples.h"
#include "mesh/triangle_mesh.h"
