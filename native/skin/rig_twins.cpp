// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/rig_twins.h"

#include "sampling/oriented_points.h"

namespace arapfields {
namespace {

/// Tolerance of mirrored points, in sizes of the shape.
constexpr double symmetric_points = 1e-4;

}  // namespace

RigTwins::RigTwins(const RigShape& rig, PointsIn points) {
  if (!rig.symmetry.is_whole()) return;
  bones = rig.symmetry.mirrored;
  Points reflected = points;
  reflected.col(rig.symmetry.axis) =
      (2.0 * rig.symmetry.offset - points.col(rig.symmetry.axis).array()).matrix();
  const Points none = Points::Zero(points.rows(), 3);
  twins = OrientedPoints(points, none).nearest(reflected, none, 0.0);
  alike = twins;
  for (Index i = 0; i < points.rows(); ++i) {
    const double distance = (points.row(twins[i]) - reflected.row(i)).norm();
    if (distance > symmetric_points * rig.extent) twins[i] = -1;
    if (distance > rig.spacing) alike[i] = -1;
  }
}

void RigTwins::average(RowMatrix<float>& values, const std::vector<Index>& others) const {
  if (bones.empty()) return;
  const RowMatrix<float> before = values;
  for (Index i = 0; i < values.rows(); ++i)
    if (const Index other = others[i]; other >= 0)
      for (Index b = 0; b < values.cols(); ++b)
        values(i, b) = 0.5f * (before(i, b) + before(other, bones[b]));
}

}  // namespace arapfields
