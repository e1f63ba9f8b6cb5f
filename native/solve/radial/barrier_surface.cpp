// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/barrier_surface.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// A way that has come so near, in cube units, has met the surface; evaluations along a way.
constexpr double met = 2e-4;
constexpr int most_steps = 40;
/// Slopes of functions below this say nothing of distances.
constexpr double least_slope = 1e-3;

}  // namespace

void require_contact(const Contact& contact) {
  for (std::size_t i = 0; i < contact.obstacles.size(); ++i) {
    const std::string name = "obstacles[" + std::to_string(i) + "]";
    require(contact.obstacles[i].function != nullptr, name, "no function", "an implicit function is needed");
    require_not_negative(name + ".margin", contact.obstacles[i].margin);
  }
  require(!contact.ground || std::isfinite(*contact.ground), "ground", "NaN or infinite",
          "a finite height is needed");
  const double length = contact.up.stableNorm();
  require(std::isfinite(length) && length > 0.0, "up", length == 0.0 ? "zero" : "NaN or infinite",
          "a finite direction of any positive length is allowed");
}

std::vector<std::string> notes_on(const ContactReport& report) {
  std::vector<std::string> notes;
  for (const HeldBack& held : report.held)
    notes.push_back("handles[" + std::to_string(held.handle) + "] is held back by " + held.by + ", " +
                    number_text(held.distance) + " from its target");
  return notes;
}

BarrierSurface::BarrierSurface(const Obstacle& obstacle, const Frame& frame)
    : function_(obstacle.function),
      frame_(frame),
      own_(obstacle.function->frame()),
      sheet_(!obstacle.function->continuous()),
      is_distance_(obstacle.function->gradient_bound() == 1.0),
      margin_(obstacle.margin / frame.scale) {}

BarrierSurface BarrierSurface::ground(const Ground& ground, const Frame& frame) {
  BarrierSurface result;
  result.frame_ = frame;
  result.up_ = ground.up.normalized();
  result.height_ = (ground.height - frame.center.dot(result.up_)) / frame.scale;
  return result;
}

/// The points in the function's cube. A fit says nothing beyond it: those points are brought to its border,
/// `beyond` gets their distances to it and `outward` the directions.
PointsF BarrierSurface::in_function(PointsIn points, Vector& beyond, Points* outward) const {
  Points own = own_.to_cube(frame_.to_mesh(points));
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
  const double unit = own_.scale / frame_.scale;
  return sheet_ ? Vector(unit * values.cast<double>().cwiseAbs()) : Vector(unit * values.cast<double>());
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
  const double unit = own_.scale / frame_.scale;
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
    result.distances[i] = unit * side * value;
    result.normals.row(i) = side * slope.normalized().transpose();
  }
  return result;
}

/// Steps as long as nothing can be near (Hart, Sphere tracing, 1996).
std::vector<BarrierSurface::Hit> BarrierSurface::first_hits(PointsIn from, PointsIn to) const {
  std::vector<Hit> hits(static_cast<std::size_t>(from.rows()));
  std::vector<Index> on_the_way, met_rows;
  Vector share = Vector::Zero(from.rows());
  for (Index i = 0; i < from.rows(); ++i) on_the_way.push_back(i);
  const auto place = [&](Index i) -> Vec3 {
    return ((1.0 - share[i]) * from.row(i) + share[i] * to.row(i)).transpose();
  };
  for (int step = 0; step < most_steps && !on_the_way.empty(); ++step) {
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
    hit.share = share[i];
    hit.normal = there.normals.row(row).transpose();
    hit.place = places.row(row).transpose() - there.distances[row] * hit.normal;
    if (sheet_ && hit.normal.dot(from.row(i).transpose() - hit.place) < 0.0) hit.normal = -hit.normal;
  }
  return hits;
}

}  // namespace arapfields
