// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "energies/handles.h"

namespace arapfields {

/// Distance, in cube units, within which handles share a motion.
constexpr double shared_within = 1e-4;

/// The rigid motion (cube coordinates) of the whole that handles ask for: the one that most of them share,
/// which also hold most of what is held; the identity if there is none, or if some handle stays at rest. A
/// handle alone moves the whole if it holds most of the `samples` of the surface. With an axis (0, 1, 2; −1:
/// none) it is symmetric across the plane on which that coordinate is 0.
ARAPFIELDS_EXPORT_TO_TESTS Mat4 shared_motion(const BoundHandles& handles, Index samples, int axis = -1);

}  // namespace arapfields
