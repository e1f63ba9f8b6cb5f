// SPDX-License-Identifier: GPL-3.0-or-later
// How handles get from one frame's targets to the next one's.
#pragma once

#include <vector>

#include "energies/handles.h"

namespace arapfields {

/// What a rigid motion carries along: x moves with velocity + turn × x.
struct Twist {
  Vec3 velocity = Vec3::Zero(), turn = Vec3::Zero();
  /// The velocities of a radial field with these coefficients (centers, constant, x, y, z).
  RowMatrix<double> of(const RowMatrix<double>& coefficients, Index centers) const;
};

/// The twist that brings points (n,3) nearest to others in so many seconds, by the weights (n).
Twist twist_between(const Points& from, const Points& to, const Vector& weights, double seconds);

std::vector<Mat4> motions_of(const BoundHandles& handles);

/// Targets of some rows of the handles' pairs (ascending) at a share of the way from earlier motions of the
/// handles to those at hand: rotations turn, all else goes straight.
Points targets_between(const BoundHandles& handles, const std::vector<Mat4>& before, double share,
                       const std::vector<Index>& rows);

}  // namespace arapfields
