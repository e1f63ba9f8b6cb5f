// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/frame.h"

#include "core/errors.h"

namespace arapfields {

Frame Frame::around(PointsIn points, double half_extent) {
  require(points.rows() > 0, "points", "none were given", "at least two different points are needed");
  require(points.allFinite(), "points", "some coordinates are NaN or infinite",
          "all coordinates must be finite");
  const Vec3 low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  const double half = 0.5 * (high - low).maxCoeff();
  require(std::isfinite(half) && half > 0.0, "points", "their bounding box has no extent",
          "at least two different points are needed");
  return Frame{0.5 * low + 0.5 * high, half / half_extent};
}

Points Frame::to_cube(PointsIn points) const { return (points.rowwise() - center.transpose()) / scale; }

Points Frame::to_mesh(PointsIn points) const { return (points * scale).rowwise() + center.transpose(); }

Mat4 Frame::motion_to_cube(const Mat4& motion) const {
  Mat4 result = motion;
  result.topRightCorner<3, 1>() =
      (motion.topLeftCorner<3, 3>() * center + motion.topRightCorner<3, 1>() - center) / scale;
  return result;
}

Mat4 Frame::placement_to_cube(const Mat4& placement) const {
  Mat4 result = placement;
  result.topLeftCorner<3, 3>() /= scale;
  result.topRightCorner<3, 1>() = (placement.topRightCorner<3, 1>() - center) / scale;
  return result;
}

}  // namespace arapfields
