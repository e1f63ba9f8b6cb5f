// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/frame.h"
#include "solve/contact.h"

namespace arapfields {

/// An obstacle, or the ground, in the cube coordinates of the surface that meets it.
class BarrierSurface {
 public:
  BarrierSurface(const Obstacle& obstacle, const Frame& frame);
  static BarrierSurface ground(const Ground& ground, const Frame& frame);

  struct Nearest {
    Vector distances;  ///< (n) negative inside; about true ones where the function is no distance
    Points normals;    ///< (n,3) unit length, outwards
  };
  Vector distances(PointsIn points) const;
  Nearest nearest(PointsIn points) const;
  /// Whether it has no inside: what counts is which side one comes from.
  bool is_sheet() const { return sheet_; }
  double margin() const { return margin_; }

  struct Hit {
    double share = 2.0;  ///< of the way; above 1: free
    Vec3 place;
    Vec3 normal;  ///< towards where the way began
  };
  /// Where straight ways first meet the surface, from places outside.
  std::vector<Hit> first_hits(PointsIn from, PointsIn to) const;

 private:
  BarrierSurface() = default;
  PointsF in_function(PointsIn points, Vector& beyond, Points* outward) const;

  std::shared_ptr<const ImplicitFunction> function_;  // null: the plane
  Frame frame_;                                       // of the surface
  Frame own_;                                         // of the function
  bool sheet_ = false;
  bool is_distance_ = true;
  double margin_ = 0.0;  // cube units
  double height_ = 0.0;
  Vec3 up_ = Vec3::UnitZ();
};

}  // namespace arapfields
