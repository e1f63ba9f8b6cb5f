// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/frame.h"
#include "solve/contact/contact.h"

namespace arapfields {

/// The signed distance of an obstacle, or of the ground, in the cube coordinates of the deforming surface:
/// that of the obstacle's implicit function, placed by a similarity.
class ContactSurface {
 public:
  ContactSurface(const Obstacle& obstacle, const Frame& frame);
  static ContactSurface ground(const Ground& ground, const Frame& frame);

  struct Nearest {
    Vector distances;  ///< (n) negative inside; to first order, Φ/‖∇Φ‖, if Φ is no distance
    Points normals;    ///< (n,3) unit gradients of the distance
  };
  /// The similarity from the function's cube to the surface's.
  const Mat4& placement() const { return place_; }
  void set_placement(const Mat4& placement);
  /// Interpolates two placements at the parameter `share` in [0, 1].
  void place_between(const Mat4& from, const Mat4& to, double share);
  /// Whether both have the same function, whatever their placements.
  bool has_same_function(const ContactSurface& other) const { return function_ == other.function_; }
  Vector distances(PointsIn points) const;
  Nearest nearest(PointsIn points) const;
  /// Whether it is a sheet without an inside: its distances are unsigned, its normals point to the near side.
  bool is_sheet() const { return sheet_; }
  /// Whether it is the ground plane.
  bool is_ground() const { return function_ == nullptr; }
  double margin() const { return margin_; }

  struct Hit {
    double parameter = 2.0;  ///< along the segment; above 1: no hit
    Vec3 place;
    Vec3 normal;  ///< unit, towards the segment's start
  };
  /// First intersections of segments with the surface, from points outside it.
  std::vector<Hit> first_hits(PointsIn from, PointsIn to) const;

 private:
  ContactSurface() = default;
  PointsF in_function(PointsIn points, Vector& beyond, Points* outward) const;

  std::shared_ptr<const ImplicitFunction> function_;  // null: the ground
  Frame own_;                                         // of the function
  Mat4 place_ = Mat4::Identity();
  Mat3 turn_ = Mat3::Identity();  // rotation of place_
  Mat4 back_ = Mat4::Identity();  // inverse of place_
  double unit_ = 1.0;             // scale of place_
  bool sheet_ = false;
  bool is_distance_ = true;
  double margin_ = 0.0;  // cube units
  double height_ = 0.0;
  Vec3 up_ = Vec3::UnitZ();
};

}  // namespace arapfields
