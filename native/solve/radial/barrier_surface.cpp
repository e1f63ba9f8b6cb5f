// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/barrier_surface.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Distance, in cube units, at which sphere tracing reports a hit, and its most steps: a segment that grazes
/// a surface needs many.
constexpr double met = 2e-4;
constexpr int most_evaluations = 150;
/// Gradient norms are clamped to at least this where they divide.
constexpr double least_slope = 1e-3;
/// Relative tolerance of a placement's uniform scale.
constexpr double even = 1e-5;
/// Lengths in mesh units beyond which an obstacle is out of reach of any arithmetic: where single precision
/// ends.
constexpr double farthest = 1e38;

}  // namespace

void require_contact(const Contact& contact) {
  for (std::size_t i = 0; i < contact.obstacles.size(); ++i) {
    const std::string name = "obstacles[" + std::to_string(i) + "]";
    require(contact.obstacles[i].function != nullptr, name, "no function", "an implicit function is needed");
    require_range(name + ".margin", contact.obstacles[i].margin, 0.0, farthest);
  }
  for (std::size_t i = 0; i < contact.obstacles.size(); ++i) {
    const Mat4& place = contact.obstacles[i].placement;
    const Mat3 linear = place.topLeftCorner<3, 3>();
    const double size = std::cbrt(linear.determinant());
    require(place.allFinite() && place.row(3) == Eigen::RowVector4d(0, 0, 0, 1) && size > 0.0 &&
                (linear.transpose() * linear - size * size * Mat3::Identity()).norm() < even * size * size,
            "obstacles[" + std::to_string(i) + "].placement", "no turn, shift and even scale",
            "a (4, 4) matrix of these alone is needed");
    require(place.cwiseAbs().maxCoeff() <= farthest, "obstacles[" + std::to_string(i) + "].placement",
            number_text(place.cwiseAbs().maxCoeff()) + " in it",
            "numbers of at most " + number_text(farthest) + " are allowed");
  }
  require_not_negative("friction", contact.friction);
  require(!contact.ground || std::isfinite(*contact.ground), "ground", "NaN or infinite",
          "a finite height is needed");
  if (contact.ground) require_range("ground", *contact.ground, -farthest, farthest);
  const double length = contact.up.stableNorm();
  require(std::isfinite(length) && length > 0.0, "up", length == 0.0 ? "zero" : "NaN or infinite",
          "a finite direction of any positive length is allowed");
}

std::vector<std::string> notes_on(const ContactReport& report) {
  std::vector<std::string> notes;
  for (const HeldBack& held : report.held)
    notes.push_back("handles[" + std::to_string(held.handle) + "] is held back by " + held.by + ", " +
                    number_text(held.distance) + " from its target");
  for (const std::string& name : report.crossing)
    notes.push_back(name + " crosses the surface; what lies inside of it stays there");
  if (const Index pairs = report.self_intersections.value_or(0); pairs > 0) {
    const Vec3& at = report.intersection;
    notes.push_back("parts of the shape pass through each other, at (" + number_text(at[0]) + ", " +
                    number_text(at[1]) + ", " + number_text(at[2]) + "): " + std::to_string(pairs) +
                    (pairs == 1 ? " pair" : " pairs") + " of triangles");
  }
  return notes;
}

BarrierSurface::BarrierSurface(const Obstacle& obstacle, const Frame& frame)
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

void BarrierSurface::set_placement(const Mat4& placement) {
  place_ = placement;
  const Mat3 linear = placement.topLeftCorner<3, 3>();
  unit_ = std::cbrt(linear.determinant());
  turn_ = linear / unit_;
  back_ = Mat4::Identity();
  back_.topLeftCorner<3, 3>() = turn_.transpose() / unit_;
  back_.topRightCorner<3, 1>() = -back_.topLeftCorner<3, 3>() * placement.topRightCorner<3, 1>();
}

void BarrierSurface::place_between(const Mat4& from, const Mat4& to, double share) {
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

BarrierSurface BarrierSurface::ground(const Ground& ground, const Frame& frame) {
  BarrierSurface result;
  result.up_ = ground.up.normalized();
  result.height_ = (ground.height - frame.center.dot(result.up_)) / frame.scale;
  return result;
}

/// Points in the coordinates of the function's cube. A fitted function is defined inside the cube alone:
/// points outside are projected onto its boundary, `beyond` gets their distances to it (0 inside), and
/// `outward`, if not null, the offsets.
PointsF BarrierSurface::in_function(PointsIn points, Vector& beyond, Points* outward) const {
  const Points own =
      (points * back_.topLeftCorner<3, 3>().transpose()).rowwise() + back_.topRightCorner<3, 1>().transpose();
  beyond = Vector::Zero(own.rows());
  if (is_distance_) return own.cast<float>();
  const Points inside = own.cwiseMax(-1.0).cwiseMin(1.0);
  if (outward != nullptr) *outward = own - inside;
  beyond = (own - inside).rowwise().norm();
  return inside.cast<float>();
}

Vector BarrierSurface::distances(PointsIn points) const {
  if (!function_) return (points * up_).array() - height_;
  if (!is_distance_) return nearest(points).distances;
  Vector beyond;
  const PointsF inside = in_function(points, beyond, nullptr);
  VectorF values(inside.rows());
  function_->evaluate(inside, values);
  return sheet_ ? Vector(unit_ * values.cast<double>().cwiseAbs()) : Vector(unit_ * values.cast<double>());
}

BarrierSurface::Nearest BarrierSurface::nearest(PointsIn points) const {
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
    if (!is_distance_) value /= std::max(size, least_slope);
    if (beyond[i] > 0.0 && value > 0.0) {
      slope = slope / std::max(size, least_slope) * value + outward.row(i).transpose();
      value = slope.norm();
    }
    const double side = sheet_ && value < 0.0 ? -1.0 : 1.0;
    result.distances[i] = unit_ * side * value;
    result.normals.row(i) = side * (turn_ * slope.normalized()).transpose();
  }
  return result;
}

/// Sphere tracing (Hart 1996).
std::vector<BarrierSurface::Hit> BarrierSurface::first_hits(PointsIn from, PointsIn to) const {
  std::vector<Hit> hits(static_cast<std::size_t>(from.rows()));
  std::vector<Index> on_the_way, met_rows;
  Vector share = Vector::Zero(from.rows());
  for (Index i = 0; i < from.rows(); ++i) on_the_way.push_back(i);
  const auto place = [&](Index i) -> Vec3 {
    return ((1.0 - share[i]) * from.row(i) + share[i] * to.row(i)).transpose();
  };
  for (int step = 0; step < most_evaluations && !on_the_way.empty(); ++step) {
    Points places(static_cast<Index>(on_the_way.size()), 3);
    for (std::size_t k = 0; k < on_the_way.size(); ++k)
      places.row(static_cast<Index>(k)) = place(on_the_way[k]).transpose();
    const Vector d = distances(places);
    std::vector<Index> left;
    for (std::size_t k = 0; k < on_the_way.size(); ++k) {
      const Index i = on_the_way[k];
      const double length = (to.row(i) - from.row(i)).norm(), free = d[static_cast<Index>(k)];
      if (free < met && step > 0) {
        met_rows.push_back(i);
        continue;
      }
      share[i] += std::max(free, met) / std::max(length, met);
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
