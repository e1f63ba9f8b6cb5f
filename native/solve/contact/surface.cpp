// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/surface.h"

#include <algorithm>
#include <cmath>

#include "solve/contact/parameters.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

using P = ContactParameters;

}  // namespace

ContactSurface::ContactSurface(const Obstacle& obstacle, const Frame& frame)
    : function_(obstacle.function),
      own_(obstacle.function->frame()),
      sheet_(!obstacle.function->continuous()),
      is_distance_(obstacle.function->gradient_bound() == 1.0),
      margin_(obstacle.margin / frame.scale) {
  Mat4 to_cube = Mat4::Identity(), from_own = Mat4::Identity();
  to_cube.topLeftCorner<3, 3>() /= frame.scale;
  to_cube.topRightCorner<3, 1>() = -frame.center / frame.scale;
  from_own.topLeftCorner<3, 3>() *= own_.scale;
  from_own.topRightCorner<3, 1>() = own_.center;
  set_placement(to_cube * obstacle.placement * from_own);
}

void ContactSurface::set_placement(const Mat4& placement) {
  place_ = placement;
  const Mat3 linear = placement.topLeftCorner<3, 3>();
  unit_ = std::cbrt(linear.determinant());
  turn_ = linear / unit_;
  back_ = Mat4::Identity();
  back_.topLeftCorner<3, 3>() = turn_.transpose() / unit_;
  back_.topRightCorner<3, 1>() = -back_.topLeftCorner<3, 3>() * placement.topRightCorner<3, 1>();
}

void ContactSurface::place_between(const Mat4& from, const Mat4& to, double share) {
  const auto unscaled = [](Mat4 placement, double& scale) {
    scale = std::cbrt(placement.topLeftCorner<3, 3>().determinant());
    placement.topLeftCorner<3, 3>() /= scale;
    return placement;
  };
  double first = 1.0, second = 1.0;
  const Mat4 a = unscaled(from, first), b = unscaled(to, second);
  Mat4 placement = motion_between(a, b, share);
  placement.topLeftCorner<3, 3>() *= (1.0 - share) * first + share * second;
  set_placement(placement);
}

ContactSurface ContactSurface::ground(const Ground& ground, const Frame& frame) {
  ContactSurface result;
  result.up_ = ground.up.normalized();
  result.height_ = (ground.height - frame.center.dot(result.up_)) / frame.scale;
  return result;
}

/// Points in the coordinates of the function's cube. A fitted function is defined inside the cube alone:
/// points outside are projected onto its boundary, `beyond` gets their distances to it (0 inside), and
/// `outward`, if not null, the offsets.
PointsF ContactSurface::in_function(PointsIn points, Vector& beyond, Points* outward) const {
  const Points own =
      (points * back_.topLeftCorner<3, 3>().transpose()).rowwise() + back_.topRightCorner<3, 1>().transpose();
  beyond = Vector::Zero(own.rows());
  if (is_distance_) return own.cast<float>();
  const Points inside = own.cwiseMax(-1.0).cwiseMin(1.0);
  if (outward != nullptr) *outward = own - inside;
  beyond = (own - inside).rowwise().norm();
  return inside.cast<float>();
}

Vector ContactSurface::distances(PointsIn points) const {
  if (!function_) return (points * up_).array() - height_;
  if (!is_distance_) return nearest(points).distances;
  Vector beyond;
  const PointsF inside = in_function(points, beyond, nullptr);
  VectorF values(inside.rows());
  function_->evaluate(inside, values);
  return sheet_ ? Vector(unit_ * values.cast<double>().cwiseAbs()) : Vector(unit_ * values.cast<double>());
}

ContactSurface::Nearest ContactSurface::nearest(PointsIn points) const {
  Nearest result;
  if (!function_) return {(points * up_).array() - height_, up_.transpose().replicate(points.rows(), 1)};
  Vector beyond;
  Points outward;
  const PointsF inside = in_function(points, beyond, &outward);
  VectorF values(inside.rows());
  PointsF slopes(inside.rows(), 3);
  if (inside.rows() > 0) function_->evaluate(inside, values, slopes);
  result.distances.resize(inside.rows());
  result.normals.resize(inside.rows(), 3);
  for (Index i = 0; i < inside.rows(); ++i) {
    Vec3 slope = slopes.row(i).transpose().cast<double>();
    double value = values[i];
    const double size = slope.norm();
    if (!is_distance_) value /= std::max(size, P::least_slope);
    if (beyond[i] > 0.0 && value > 0.0) {
      slope = slope / std::max(size, P::least_slope) * value + outward.row(i).transpose();
      value = slope.norm();
    }
    const double side = sheet_ && value < 0.0 ? -1.0 : 1.0;
    result.distances[i] = unit_ * side * value;
    result.normals.row(i) = side * (turn_ * slope.normalized()).transpose();
  }
  return result;
}

/// Sphere tracing (Hart 1996).
std::vector<ContactSurface::Hit> ContactSurface::first_hits(PointsIn from, PointsIn to) const {
  std::vector<Hit> hits(static_cast<std::size_t>(from.rows()));
  std::vector<Index> on_the_way, met_rows;
  Vector share = Vector::Zero(from.rows());
  for (Index i = 0; i < from.rows(); ++i) on_the_way.push_back(i);
  const auto place = [&](Index i) -> Vec3 {
    return ((1.0 - share[i]) * from.row(i) + share[i] * to.row(i)).transpose();
  };
  for (int step = 0; step < P::most_tracing_steps && !on_the_way.empty(); ++step) {
    Points places(static_cast<Index>(on_the_way.size()), 3);
    for (std::size_t k = 0; k < on_the_way.size(); ++k)
      places.row(static_cast<Index>(k)) = place(on_the_way[k]).transpose();
    const Vector d = distances(places);
    std::vector<Index> left;
    for (std::size_t k = 0; k < on_the_way.size(); ++k) {
      const Index i = on_the_way[k];
      const double length = (to.row(i) - from.row(i)).norm(), free = d[static_cast<Index>(k)];
      if (free < P::hit_distance && step > 0) {
        met_rows.push_back(i);
        continue;
      }
      share[i] += std::max(free, P::hit_distance) / std::max(length, P::hit_distance);
      if (share[i] < 1.0) left.push_back(i);
    }
    on_the_way.swap(left);
  }
  Points places(static_cast<Index>(met_rows.size()), 3);
  for (std::size_t k = 0; k < met_rows.size(); ++k)
    places.row(static_cast<Index>(k)) = place(met_rows[k]).transpose();
  const Nearest there = nearest(places);
  for (std::size_t k = 0; k < met_rows.size(); ++k) {
    const Index i = met_rows[k], row = static_cast<Index>(k);
    Hit& hit = hits[static_cast<std::size_t>(i)];
    hit.parameter = share[i];
    hit.normal = there.normals.row(row).transpose();
    hit.place = places.row(row).transpose() - there.distances[row] * hit.normal;
    if (sheet_ && hit.normal.dot(from.row(i).transpose() - hit.place) < 0.0) hit.normal = -hit.normal;
  }
  return hits;
}

}  // namespace arapfields
