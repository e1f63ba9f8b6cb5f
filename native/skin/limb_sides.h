// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "skin/rig_shape.h"

namespace arapfields {

/// A leg does not move the other. Takes bones of the other side farther away, up to infinity, for points
/// (n,3) that lie along a limb past the place where it parts from its twin, and that face the other across a
/// gap. Distances (n, bones), in units of the points.
void keep_limbs_apart(const RigShape& rig, const PiecePoints& given, RowMatrix<float>& distances);

}  // namespace arapfields
