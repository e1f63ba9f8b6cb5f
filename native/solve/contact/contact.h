// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/export.h"
#include "core/implicit.h"

namespace arapfields {

/// A solid {Φ < 0} from which a surface keeps the distance `margin`, in mesh units. A discontinuous function,
/// such as the signed distance to an open mesh, is a sheet with two sides, which the surface does not cross.
struct Obstacle {
  std::shared_ptr<const ImplicitFunction> function;
  double margin = 0.0;
  Mat4 placement = Mat4::Identity();  ///< a similarity, from the function's to mesh coordinates
};

/// The half-space below a height along `up`, in mesh coordinates, as an obstacle.
struct Ground {
  double height = 0.0;
  Vec3 up = Vec3::UnitZ();
  bool operator==(const Ground&) const = default;
};

/// The contact constraints of a solve.
struct Contact {
  std::vector<Obstacle> obstacles;
  std::optional<double> ground;  ///< height along `up`, in mesh coordinates; none: no ground
  Vec3 up = Vec3::UnitZ();
  double friction = 0.5;  ///< Coulomb's coefficient at obstacles and the ground, in secondary motion alone
  bool itself = false;    ///< self-contact, except of parts that touch or overlap at rest
  bool any() const { return !obstacles.empty() || ground || itself; }
};

/// A handle that contact keeps from its target.
struct HeldBack {
  Index handle;
  std::string by;   ///< "obstacles[0]", "ground" or "itself"
  double distance;  ///< mean distance to the target, mesh units
};

/// The contact state of a surface after a solve.
struct ContactReport {
  double deepest = 0.0;    ///< greatest penetration depth beyond a margin, mesh units
  double touching = 0.0;   ///< fraction of the area in contact (with positive pressure)
  bool unsettled = false;  ///< the depth is above the tolerance: more iterations reduce it
  std::vector<HeldBack> held;
  /// Names of the obstacles that cross the surface at the start: samples inside them are not pushed out.
  std::vector<std::string> crossing;
  /// Pairs of triangles of the samples' mesh, of parts that are far from each other at rest, that pass
  /// through each other and do not at rest; none: without self-contact, or the samples know no mesh.
  std::optional<Index> self_intersections;
  Vec3 intersection = Vec3::Zero();  ///< where one pair does, mesh units
};

/// One sentence for each handle that is held back, for each obstacle that crosses the surface, and for parts
/// of it that pass through each other.
std::vector<std::string> notes_on(const ContactReport& report);

/// Throws InvalidInput for null functions and for numbers that are negative or not finite.
ARAPFIELDS_EXPORT void require_contact(const Contact& contact);

}  // namespace arapfields
