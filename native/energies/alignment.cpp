// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/alignment.h"

#include <algorithm>
#include <string>

#include "core/decompositions.h"
#include "core/errors.h"
#include "energies/rotation.h"

namespace arapfields {

Alignment best_alignment(PointsIn points, PointsIn targets, const Vector& weights, double tie) {
  Alignment result;
  const double total = weights.sum();
  const Eigen::RowVector3d from = weights.transpose() * points / total;
  const Eigen::RowVector3d to = weights.transpose() * targets / total;
  const Points arms = points.rowwise() - from, target_arms = targets.rowwise() - to;
  const Mat3 spread = cross_moments(target_arms, Points(weights.asDiagonal() * arms));
  result.rotation = closest_rotation(spread + (tie * spread.norm() + 1e-300) * Mat3::Identity());
  result.translation = to.transpose() - result.rotation * from.transpose();
  const Points moved = (points * result.rotation.transpose()).rowwise() + result.translation.transpose();
  const double before = weights.dot((points - targets).rowwise().squaredNorm());
  if (before > 0.0) result.gain = weights.dot((moved - targets).rowwise().squaredNorm()) / before;
  return result;
}

Mat4 rigid_motion(PointsIn points, PointsIn moved, const Vector& weights) {
  require(points.rows() > 0, "points", "there are none", "at least one is needed");
  require(points.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  require(moved.rows() == points.rows(), "moved", std::to_string(moved.rows()) + " of them",
          "as many as points are needed, " + std::to_string(points.rows()));
  require(moved.allFinite(), "moved", "some coordinates are NaN or infinite", "all must be finite");
  require(weights.size() == 0 || (weights.size() == points.rows() && weights.allFinite() &&
                                  weights.minCoeff() >= 0.0 && weights.maxCoeff() > 0.0),
          "weights", std::to_string(weights.size()) + " numbers, or negative, non-finite or only zeros",
          "one weight ≥ 0 for each of the " + std::to_string(points.rows()) + " points, or none, is needed");
  // Units in which squares neither overflow nor underflow.
  const Vec3 origin = points.row(0), end = moved.row(0);
  Points from = points.rowwise() - origin.transpose(), to = moved.rowwise() - end.transpose();
  const double unit = std::max(from.cwiseAbs().maxCoeff(), to.cwiseAbs().maxCoeff());
  if (unit > 0.0) from /= unit, to /= unit;
  const Vector normalized_weights =
      weights.size() > 0 ? Vector(weights / weights.maxCoeff()) : Vector::Ones(from.rows());
  const Alignment alignment = best_alignment(from, to, normalized_weights, 1e-12);
  Mat4 result = Mat4::Identity();
  result.topLeftCorner<3, 3>() = alignment.rotation;
  result.topRightCorner<3, 1>() = end + unit * alignment.translation - alignment.rotation * origin;
  return result;
}

}  // namespace arapfields
