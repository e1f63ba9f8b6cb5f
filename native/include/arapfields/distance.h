// SPDX-License-Identifier: GPL-3.0-or-later
// Exact signed distances and winding numbers of triangle soups: SignedDistance, signed_distance; MeshSdf, an
// implicit function.
#pragma once

#include "distance/mesh_sdf.h"
#include "distance/signed_distance.h"
