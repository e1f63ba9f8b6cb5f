// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// The rigid motion that maps points closest to their targets in weighted least squares, and the remaining
/// fraction of the sum of squares (1: no gain).
struct Alignment {
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();
  double gain = 1.0;
};
/// `tie`, a fraction of the points' covariance, regularises towards no rotation, which collinear points leave
/// undetermined about their line.
Alignment best_alignment(PointsIn points, PointsIn targets, const Vector& weights, double tie = 1e-6);

/// The same motion as a matrix, of points (n,3) → moved (n,3): of all rotations and translations the one with
/// the least weighted sum of squares (Kabsch 1976, "A solution for the best rotation to relate two sets of
/// vectors"). Never a reflection; points in one place, or on one line, turn as little as they can. Weights
/// (n, none negative; empty: all 1). Throws InvalidInput for no points, other counts, NaN or infinity.
ARAPFIELDS_EXPORT Mat4 rigid_motion(PointsIn points, PointsIn moved, const Vector& weights = {});

}  // namespace arapfields
