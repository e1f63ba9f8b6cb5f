// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/types.h"
#include "options/secondary.h"

namespace arapfields {

/// Gives a surface a mass: it lags behind its handles, overshoots and settles.
struct SecondaryMotion {
  SecondaryMotionOptions options;
  Vector masses = {};                 ///< of the surface samples, relative, none negative; empty: all 1
  Vec3 up = Vec3::UnitZ();            ///< opposite to gravity
  std::optional<double> ground = {};  ///< height along `up`, in mesh coordinates; none: no ground
};

/// The contact state between two time steps: obstacles' placements, multipliers, and points' sides.
struct ContactState {
  std::uint64_t points = 0;      ///< a hash of the contact points; 0: no contact
  std::vector<Mat4> placements;  ///< from the functions' cubes to the surface's
  struct Pressure {
    Index row;
    Index surface;
    double pressure;
    Vec3 anchor;  ///< of friction
  };
  std::vector<Pressure> pressures;  ///< the positive ones
  struct Inside {
    Index row;
    Index surface;
    Vec3 outside;
    double clearance;  ///< distance at `outside`; −∞: left inside, where an obstacle crosses the surface
  };
  std::vector<Inside> inside;  ///< last outside positions of points that may be inside
  /// For each surface, whether it crosses the shape at or beside each sample; empty: nowhere.
  std::vector<std::vector<bool>> crossed;
};

/// Position and velocity of a surface: all that the next time step depends on, beside the handles' targets.
struct MotionState {
  RowMatrix<double> coefficients;   ///< (size,3) of the radial basis
  RowMatrix<double> velocities;     ///< (size,3) of the coefficients, 1/second
  RowMatrix<double> accelerations;  ///< (size,3), 1/second²; empty: unknown
  std::vector<Mat4> motions;        ///< of the handles, in cube coordinates; empty: unknown
  ContactState contact = {};
};

}  // namespace arapfields
