// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// How much bones on the opposite side of a symmetric rig may move points (n,3), so that one leg does not
/// move the other: fully where the limbs are joined, falling to zero along a limb beyond the place where it
/// separates from its twin, and not across a gap that the points face. If parts of the shape touch, a point's
/// side is that of its owner bone.
struct LimbSides {
  /// `near` (n) are the points' nearest nodes; interior distances (n, bones), in the points' units.
  LimbSides(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& near,
            const RowMatrix<float>& distances);

  std::vector<int> sides;      ///< (n) side of each point, −1 or 1; 0: all bones have full influence
  std::vector<double> shares;  ///< (n) influence of the opposite side's bones, 0 to 1
};

}  // namespace arapfields
