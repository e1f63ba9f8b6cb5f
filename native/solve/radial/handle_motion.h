// SPDX-License-Identifier: GPL-3.0-or-later
// Interpolation of handles' motions between two frames, and their mean rigid velocity.
#pragma once

#include <vector>

#include "energies/handles.h"

namespace arapfields {

/// A rigid velocity field: velocity + turn × x at x.
struct Twist {
  Vec3 velocity = Vec3::Zero();
  Vec3 turn = Vec3::Zero();
  /// This velocity at the points of a radial field, as coefficients (centers, constant, x, y, z).
  RowMatrix<double> of(const RowMatrix<double>& coefficients, Index centers) const;
};

/// The twist that moves points (n,3) to others in `seconds`, a least-squares fit with weights (n).
Twist twist_between(const Points& from, const Points& to, const Vector& weights, double seconds);

/// Interpolates two affine motions at the parameter `share`: rotations about the pivot by slerp, all else
/// linearly.
Mat4 motion_between(const Mat4& from, const Mat4& to, double share, const Vec3& pivot = Vec3::Zero());

/// Points (n,3) after an affine motion.
Points affine_image(PointsIn points, const Mat4& motion);

std::vector<Mat4> motions_of(const BoundHandles& handles);

/// Interpolates from earlier motions of the handles to the current ones, each about its handle's centre.
std::vector<Mat4> motions_between(const BoundHandles& handles, const std::vector<Mat4>& before, double share);

/// Targets (n,3) of some rows of the handles' pairs (ascending) under these motions.
Points targets_of(const BoundHandles& handles, const std::vector<Mat4>& motions,
                  const std::vector<Index>& rows);

}  // namespace arapfields
