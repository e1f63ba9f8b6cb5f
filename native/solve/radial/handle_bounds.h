// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// What keeps handles from where motions would take them: of each the translations after which all that it
/// holds, as it is and not squashed, is beyond the planes that were found.
class HandleBounds {
 public:
  HandleBounds(RadialState& state, const std::vector<Mat4>& motions);
  /// The least translation of a handle within its bounds, and the surface that asks for the most of it; −1:
  /// none.
  std::pair<Vec3, Index> least_translation(Index handle);

 private:
  /// A translation moves a part along `normal` by `depth` or more.
  struct Bound {
    Vec3 normal;
    double depth;
    Index surface;
    std::optional<Vec3> target = std::nullopt;  ///< of the place that stays outside of a solid
    bool over = false;                          ///< by its reflection
  };
  /// A handle at one point, beneath which the shape keeps its width.
  struct Pin {
    Index handle;
    Vec3 rest;
    Vec3 now;
    Vec3 target;
    double width;
  };
  /// A place of a plane, or its reflection, and the handle that holds it; −1: none.
  struct Place {
    Vec3 rest;
    Vec3 now;
    Index holder;
  };

  static std::pair<Vec3, Index> within(const std::vector<Bound>& bounds);
  static double beyond(const Pin& pin, const Vec3& normal, double offset, const Place& place);
  std::vector<Pin> pins() const;
  Vec3 turned(Vec3 arm, bool over) const;
  Place place_of(Index row, bool over) const;
  Vec3 target_of(const Place& place) const;
  void bind(const ContactPlane& plane, bool over);
  void bind_to_surface(const ContactPlane& plane, const Vec3& normal, const Place& place, bool over);
  void bind_to_itself(const ContactPlane& plane, const Vec3& normal, const Place& first, const Place& second);
  std::vector<Bound>& bounds_of(Index handle) { return bounds_[static_cast<std::size_t>(handle)]; }
  bool turn(std::vector<Bound>& bounds, const Vec3& way) const;

  RadialState& state_;
  const std::vector<Mat4>& motions_;
  const std::vector<Index>& holders_;
  Vector masses_;  // how little each handle gives way to others
  std::vector<Pin> pins_;
  Points places_;  // of the planes, as they are now; empty without pins
  std::vector<std::vector<Bound>> bounds_;
};

}  // namespace arapfields
