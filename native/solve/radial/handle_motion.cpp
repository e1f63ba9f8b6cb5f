// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/handle_motion.h"

#include <Eigen/Geometry>

#include "core/decompositions.h"

namespace arapfields {
namespace {

/// Regularisation of the inertia tensor, which is singular for collinear points and for a single one: a
/// fraction of the trace, and an absolute term in cube units².
constexpr double thinnest = 1e-6, smallest = 1e-12;
/// Tolerance within which a linear map is interpolated as a rotation.
constexpr double rotation_error = 1e-6;

bool is_rotation(const Mat3& m) {
  return (m.transpose() * m - Mat3::Identity()).norm() < rotation_error && m.determinant() > 0.0;
}

Mat3 linear_between(const Mat3& a, const Mat3& b, double share) {
  if (!is_rotation(a) || !is_rotation(b)) return (1.0 - share) * a + share * b;
  return Eigen::Quaterniond(a).slerp(share, Eigen::Quaterniond(b)).toRotationMatrix();
}

}  // namespace

Mat4 motion_between(const Mat4& from, const Mat4& to, double share, const Vec3& pivot) {
  const auto a = from.topLeftCorner<3, 3>(), b = to.topLeftCorner<3, 3>();
  const Vec3 start = a * pivot + from.topRightCorner<3, 1>(), end = b * pivot + to.topRightCorner<3, 1>();
  Mat4 result = Mat4::Identity();
  result.topLeftCorner<3, 3>() = linear_between(a, b, share);
  result.topRightCorner<3, 1>() = (1.0 - share) * start + share * end - result.topLeftCorner<3, 3>() * pivot;
  return result;
}

Points affine_image(PointsIn points, const Mat4& motion) {
  return (points * motion.topLeftCorner<3, 3>().transpose()).rowwise() +
         motion.topRightCorner<3, 1>().transpose();
}

RowMatrix<double> Twist::of(const RowMatrix<double>& coefficients, Index centers) const {
  Mat3 cross;
  cross << 0.0, -turn.z(), turn.y(), turn.z(), 0.0, -turn.x(), -turn.y(), turn.x(), 0.0;
  RowMatrix<double> result = coefficients * cross.transpose();
  result.row(centers) += velocity.transpose();
  return result;
}

Twist twist_between(const Points& from, const Points& to, const Vector& weights, double seconds) {
  Twist twist;
  const double total = weights.sum();
  if (from.rows() == 0 || !(total > 0.0)) return twist;
  const Points middle = 0.5 * (from + to), velocities = (to - from) / seconds;
  const Vec3 center = middle.transpose() * weights / total, mean = velocities.transpose() * weights / total;
  Mat3 inertia = Mat3::Zero();
  Vec3 moment = Vec3::Zero();
  for (Index i = 0; i < middle.rows(); ++i) {
    const Vec3 arm = middle.row(i).transpose() - center;
    inertia += weights[i] / total * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose());
    moment += weights[i] / total * arm.cross(velocities.row(i).transpose() - mean);
  }
  inertia += (thinnest * inertia.trace() + smallest) * Mat3::Identity();
  twist.turn = solve_definite(inertia, moment);
  twist.velocity = mean - twist.turn.cross(center);
  return twist;
}

std::vector<Mat4> motions_of(const BoundHandles& handles) {
  std::vector<Mat4> motions;
  for (Index i = 0; i < handles.count(); ++i) motions.push_back(handles.motion(i));
  return motions;
}

std::vector<Mat4> motions_between(const BoundHandles& handles, const std::vector<Mat4>& before,
                                  double share) {
  std::vector<Mat4> motions;
  for (Index i = 0; i < handles.count(); ++i) {
    const Index begin = handles.begin(i), end = handles.begin(i + 1);
    const Vec3 pivot = handles.sources().middleRows(begin, end - begin).colwise().mean();
    motions.push_back(motion_between(before[static_cast<std::size_t>(i)], handles.motion(i), share, pivot));
  }
  return motions;
}

Points targets_of(const BoundHandles& handles, const std::vector<Mat4>& motions,
                  const std::vector<Index>& rows) {
  Points targets(static_cast<Index>(rows.size()), 3);
  Index row = 0;
  for (Index i = 0; i < handles.count(); ++i) {
    const Mat4& motion = motions[static_cast<std::size_t>(i)];
    for (; row < targets.rows() && rows[static_cast<std::size_t>(row)] < handles.begin(i + 1); ++row)
      targets.row(row) = affine_image(handles.sources().row(rows[static_cast<std::size_t>(row)]), motion);
  }
  return targets;
}

}  // namespace arapfields
