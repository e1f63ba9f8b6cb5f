// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// What a rig's symmetry across a plane of the axes means for its bones and for some points; nothing where
/// the rig has none.
struct RigTwins {
  RigTwins(const RigShape& rig, PointsIn points);

  /// Values (points, bones) averaged with those of the mirrored points and bones.
  void average(RowMatrix<float>& values) const;
  /// The mirrored point, −1 where there is none.
  Index twin(Index point) const { return twins.empty() ? -1 : twins[point]; }

  std::vector<Index> bones;  ///< mirrored bone of each; empty without a symmetry
  std::vector<Index> twins;
};

}  // namespace arapfields
