// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// What a rig's symmetry across a plane of the axes means for its bones and for some points; nothing where
/// the rig has none.
struct RigTwins {
  RigTwins(const RigShape& rig, PointsIn points);

  /// The mirrored point, −1 where there is none.
  Index twin(Index point) const { return twins.empty() ? -1 : twins[point]; }
  /// The point nearest to the mirrored place, −1 where none is near. It stands for a twin, so that points
  /// without one do not differ from their neighbours with one.
  Index like(Index point) const { return alike.empty() ? -1 : alike[point]; }
  /// Values (points, bones) averaged with those of the twins, or of the points like them, and mirrored bones.
  void average_twins(RowMatrix<float>& values) const { average(values, twins); }
  void average_alike(RowMatrix<float>& values) const { average(values, alike); }

  std::vector<Index> bones;  ///< mirrored bone of each; empty without a symmetry
  std::vector<Index> twins;
  std::vector<Index> alike;

 private:
  void average(RowMatrix<float>& values, const std::vector<Index>& others) const;
};

}  // namespace arapfields
