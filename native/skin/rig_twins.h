// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// The correspondence of mirrored bones, and of mirrored points, under a rig's symmetry across a coordinate
/// plane; empty without one.
struct RigTwins {
  RigTwins(const RigShape& rig, PointsIn points);

  /// The mirrored point, −1: none.
  Index twin(Index point) const { return twins.empty() ? -1 : twins[point]; }
  /// The point nearest to the mirrored place, −1: none is near. It replaces a missing twin, so that points
  /// without one get weights like their neighbours.
  Index like(Index point) const { return alike.empty() ? -1 : alike[point]; }
  /// Averages values (points, bones) with those of the twins (or their replacements) and mirrored bones.
  void average_twins(RowMatrix<float>& values) const { average(values, twins); }
  void average_alike(RowMatrix<float>& values) const { average(values, alike); }

  std::vector<Index> bones;  ///< mirrored bone of each; empty without a symmetry
  std::vector<Index> twins;
  std::vector<Index> alike;

 private:
  void average(RowMatrix<float>& values, const std::vector<Index>& others) const;
};

}  // namespace arapfields
