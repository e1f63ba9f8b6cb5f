// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/export.h"
#include "core/implicit.h"

namespace arapfields {

/// A solid that a surface stays outside of, at this distance of mesh units. A function that is not
/// continuous, such as the distance from an open mesh, is a sheet that nothing passes.
struct Obstacle {
  std::shared_ptr<const ImplicitFunction> function;
  double margin = 0.0;
  Mat4 placement = Mat4::Identity();  ///< of the function's space: turns, moves, and scales evenly
};

/// All that is below a height along `up`, in mesh coordinates.
struct Ground {
  double height = 0.0;
  Vec3 up = Vec3::UnitZ();
  bool operator==(const Ground&) const = default;
};

/// What a surface does not pass.
struct Contact {
  std::vector<Obstacle> obstacles;
  std::optional<double> ground;  ///< height along `up`, in mesh coordinates; none: no ground
  Vec3 up = Vec3::UnitZ();
  double friction = 0.5;  ///< Coulomb's coefficient at obstacles and the ground, in secondary motion alone
  bool itself = false;    ///< its own parts, but for what touches or overlaps at rest
  bool any() const { return !obstacles.empty() || ground || itself; }
};

/// A handle that contact keeps from its target.
struct HeldBack {
  Index handle;
  std::string by;   ///< "obstacles[0]", "ground" or "itself"
  double distance;  ///< mean distance to the target, mesh units
};

/// How a surface touches, after a solve.
struct ContactReport {
  double deepest = 0.0;    ///< how far a sample is beyond a margin, mesh units
  double touching = 0.0;   ///< share of the area that presses
  bool unsettled = false;  ///< more steps would bring it out
  std::vector<HeldBack> held;
  /// Names of the obstacles that cross the surface where it began: what lies inside of them stays there.
  std::vector<std::string> crossing;
};

/// Sentences that say which handles are held back by what, and what crosses the surface.
std::vector<std::string> notes_on(const ContactReport& report);

/// Throws InvalidInput for null functions and for numbers that are negative or not finite.
ARAPFIELDS_EXPORT void require_contact(const Contact& contact);

}  // namespace arapfields
