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
  /// Where the function's space lies, in the surface's cube.
  const Mat4& placement() const { return place_; }
  void set_placement(const Mat4& placement);
  /// A share of the way between two placements.
  void place_between(const Mat4& from, const Mat4& to, double share);
  /// Whether both have the same function, wherever it lies.
  bool is_alike(const BarrierSurface& other) const { return function_ == other.function_; }
  Vector distances(PointsIn points) const;
  Nearest nearest(PointsIn points) const;
  /// Whether it has no inside: what counts is which side one comes from.
  bool is_sheet() const { return sheet_; }
  /// Whether it has no edge.
  bool is_flat() const { return function_ == nullptr; }
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
  Frame own_;                                         // of the function
  Mat4 place_ = Mat4::Identity();
  Mat3 turn_ = Mat3::Identity();  // of the function's directions
  Mat4 back_ = Mat4::Identity();  // of the surface's cube into the function's
  double unit_ = 1.0;             // of the function's cube, in the surface's
  bool sheet_ = false;
  bool is_distance_ = true;
  double margin_ = 0.0;  // cube units
  double height_ = 0.0;
  Vec3 up_ = Vec3::UnitZ();
};

}  // namespace arapfields
