// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// A leg does not move the other. How much bones of the other side may move points (n,3): wholly where the
/// limbs are joined; less and less along a limb from the place where it parts from its twin, then not at all,
/// and not across a gap that the points face. Where parts touch, each goes by the bone that it belongs to.
struct LimbSides {
  /// `near` are the nodes that the points are nearest to; distances (n, bones), in units of the points.
  LimbSides(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& near,
            const RowMatrix<float>& distances);

  std::vector<int> sides;      ///< (n) of each point: −1 and 1; 0 where all bones count
  std::vector<double> shares;  ///< (n) from 0 to 1
};

}  // namespace arapfields
