// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "skin/rig_shape.h"

namespace arapfields {

/// A leg does not move the other. Takes bones of the other side farther away, up to infinity, for points
/// (n,3) that lie along a limb past the place where it parts from its twin, and that face the other across a
/// gap. Where parts touch, each goes by the bone that it belongs to. `near` are the nodes that the points are
/// nearest to; distances (n, bones), in units of the points.
void keep_limbs_apart(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& near,
                      RowMatrix<float>& distances);

}  // namespace arapfields
