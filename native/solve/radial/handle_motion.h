// SPDX-License-Identifier: GPL-3.0-or-later
// The motion of handles from the targets of one frame to those of the next.
#pragma once

#include <vector>

#include "energies/handles.h"

namespace arapfields {

/// The velocities of a rigid motion: velocity + turn × x at x.
struct Twist {
  Vec3 velocity = Vec3::Zero();
  Vec3 turn = Vec3::Zero();
  /// The velocities of a radial field with these coefficients (centers, constant, x, y, z).
  RowMatrix<double> of(const RowMatrix<double>& coefficients, Index centers) const;
};

/// The twist that brings points (n,3) nearest to others in `seconds`, by the weights (n).
Twist twist_between(const Points& from, const Points& to, const Vector& weights, double seconds);

/// A share of the way from one affine motion to another: rotations about the pivot by slerp, all else along
/// lines.
Mat4 motion_between(const Mat4& from, const Mat4& to, double share, const Vec3& pivot = Vec3::Zero());

/// Points (n,3) after an affine motion.
Points affine_image(PointsIn points, const Mat4& motion);

std::vector<Mat4> motions_of(const BoundHandles& handles);

/// At a share of the way from earlier motions of the handles to the current ones, about the middle of each.
std::vector<Mat4> motions_between(const BoundHandles& handles, const std::vector<Mat4>& before, double share);

/// Where motions of the handles take some rows of their pairs (ascending).
Points targets_of(const BoundHandles& handles, const std::vector<Mat4>& motions,
                  const std::vector<Index>& rows);

}  // namespace arapfields
