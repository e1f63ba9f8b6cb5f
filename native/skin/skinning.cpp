// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/skinning.h"

#include <Eigen/Geometry>

#include "core/errors.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

/// A rigid motion as a dual quaternion.
struct DualQuaternion {
  Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = Eigen::Vector4d::Zero();  // (x, y, z, w)

  DualQuaternion() = default;
  explicit DualQuaternion(const Mat4& motion) {
    const Eigen::Quaterniond turn(Mat3(motion.topLeftCorner<3, 3>()));
    const Vec3 shift = motion.topRightCorner<3, 1>();
    real = turn.normalized().coeffs();
    dual = 0.5 * (Eigen::Quaterniond(0.0, shift[0], shift[1], shift[2]) * Eigen::Quaterniond(real)).coeffs();
  }
  void add(double weight, const DualQuaternion& other) {
    const double sign = real.dot(other.real) < 0.0 ? -weight : weight;  // q and −q are one rotation
    real += sign * other.real;
    dual += sign * other.dual;
  }
  Vec3 operator()(const Vec3& point) const {
    const double length = real.norm();
    const Eigen::Quaterniond turn(Eigen::Vector4d(real / length)), moves(Eigen::Vector4d(dual / length));
    return turn * point + 2.0 * (moves * turn.conjugate()).vec();
  }
};

}  // namespace

Points skin(PointsIn vertices, const RowMatrix<float>& weights, const std::vector<Mat4>& motions,
            SkinMethod method) {
  const auto counted = [](Index count) { return std::to_string(count) + " of them"; };
  require(weights.rows() == vertices.rows(), "weights", counted(weights.rows()),
          "one row a vertex is needed");
  require(weights.cols() == static_cast<Index>(motions.size()), "motions",
          counted(static_cast<Index>(motions.size())), "one for each column of the weights is needed");
  require(vertices.allFinite() && weights.allFinite(), "weights", "NaN or infinity", "all must be finite");
  std::vector<DualQuaternion> duals;
  for (const Mat4& motion : motions) {
    require(motion.allFinite(), "motions", "NaN or infinity", "all must be finite");
    if (method == SkinMethod::dual_quaternion) duals.emplace_back(motion);
  }
  Points result(vertices.rows(), 3);
  parallel_for(0, vertices.rows(), 256, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const Vec3 rest = vertices.row(i);
      Vec3 moved = Vec3::Zero();
      DualQuaternion blended;
      for (Index b = 0; b < weights.cols(); ++b) {
        const double weight = static_cast<double>(weights(i, b));
        if (weight == 0.0) continue;
        if (method == SkinMethod::linear)
          moved += weight * (motions[b].topLeftCorner<3, 3>() * rest + motions[b].topRightCorner<3, 1>());
        else
          blended.add(weight, duals[b]);
      }
      result.row(i) = method == SkinMethod::linear ? moved : blended(rest);
    }
  });
  return result;
}

}  // namespace arapfields
