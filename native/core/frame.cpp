// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/frame.h"

#include <algorithm>
#include <cmath>

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

Frame Frame::balanced(PointsIn centroids, const Vector& areas, const Vector& spreads,
                      double gyration_radius) {
  constexpr int most_rounds = 60;
  constexpr double far = 3.0, settled = 1e-13;
  require(centroids.rows() > 0, "points", "none were given", "at least two different points are needed");
  require(centroids.allFinite() && areas.allFinite() && spreads.allFinite(), "points",
          "some coordinates are NaN or infinite", "all coordinates must be finite");
  // Units in which squares neither overflow nor vanish.
  const Vec3 origin = 0.5 * centroids.colwise().minCoeff() + 0.5 * centroids.colwise().maxCoeff();
  const double unit = std::max((centroids.rowwise() - origin.transpose()).cwiseAbs().maxCoeff(),
                               spreads.size() > 0 ? std::sqrt(spreads.maxCoeff()) : 0.0);
  const double total = areas.sum();
  require(std::isfinite(unit) && unit > 0.0 && std::isfinite(total) && total > 0.0, "points",
          "they have no extent", "at least two different points are needed");
  const Points placed = (centroids.rowwise() - origin.transpose()) / unit;
  const Vector weights = areas / total;
  const Vector inner = spreads.size() > 0 ? Vector(spreads / unit / unit) : Vector::Zero(areas.size());
  Vec3 center = placed.transpose() * weights;
  double square = 0.0, before = -1.0;
  const auto squares = [&] {
    return Vector((placed.rowwise() - center.transpose()).rowwise().squaredNorm() + inner);
  };
  Vector distances = squares();
  square = weights.dot(distances);
  for (int round = 0; round < most_rounds && std::abs(square - before) > settled * square; ++round) {
    before = square;
    const double limit = far * far * square;
    const Vector pull = weights.array() * (limit / distances.array().max(limit)).sqrt();
    center = placed.transpose() * pull / pull.sum();
    distances = squares();
    square = weights.dot(distances.cwiseMin(limit));
  }
  return Frame{origin + unit * center, unit * std::sqrt(square) / gyration_radius};
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
