// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// Contact constraints on the translations of handles: a translation is feasible if it brings all points that
/// the handle holds, moved rigidly by the handle's motion, to the feasible side of the contact planes.
class HandleBounds {
 public:
  HandleBounds(RadialState& state, const std::vector<Mat4>& motions);
  /// The feasible translation t of least norm, and the surface of the largest multiplier; −1: t is zero.
  std::pair<Vec3, Index> least_translation(Index handle);

 private:
  /// The constraint normal·t ≥ depth on a translation t.
  struct Bound {
    Vec3 normal;
    double depth;
    Index surface;
    std::optional<Vec3> target = std::nullopt;  ///< the point's position under the motion; none: fixed normal
    bool mirrored = false;                      ///< of the plane's reflection (symmetric fields)
  };
  /// A point handle. The shape between it and the contact planes below keeps its width.
  struct Pin {
    Index handle;
    Vec3 rest;
    Vec3 now;
    Vec3 target;
    double width;  ///< of the shape at the handle, in cube units
  };
  /// A point of a contact plane, or its reflection, and the handle that holds it; −1: none.
  struct Place {
    Vec3 rest;
    Vec3 now;
    Index holder;
  };

  static std::pair<Vec3, Index> solve(const std::vector<Bound>& bounds);
  static double depth_of(const Pin& pin, const Vec3& normal, double offset, const Place& place);
  std::vector<Pin> pins() const;
  Vec3 reflected(Vec3 arm, bool mirrored) const;
  Place place_of(Index row, bool mirrored) const;
  Vec3 target_of(const Place& place) const;
  void bind(const ContactPlane& plane, bool mirrored);
  void bind_to_surface(const ContactPlane& plane, const Vec3& normal, const Place& place, bool mirrored);
  void bind_to_itself(const ContactPlane& plane, const Vec3& normal, const Place& first, const Place& second);
  std::vector<Bound>& bounds_of(Index handle) { return bounds_[static_cast<std::size_t>(handle)]; }
  bool linearise_anew(std::vector<Bound>& bounds, const Vec3& translation) const;

  RadialState& state_;
  const std::vector<Mat4>& motions_;
  const std::vector<Index>& holders_;
  Vector masses_;  // weight of each handle: of two that meet, the lighter one moves more
  std::vector<Pin> pins_;
  Points places_;  // current positions of the contact set's points; empty without pins
  std::vector<std::vector<Bound>> bounds_;
};

}  // namespace arapfields
