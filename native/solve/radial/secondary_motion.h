// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "core/types.h"
#include "options/secondary.h"

namespace arapfields {

/// Gives a surface a mass: it lags behind its handles, overshoots and settles.
struct SecondaryMotion {
  SecondaryMotionOptions options;
  Vector masses = {};                 ///< of the surface samples, relative, none negative; empty: all 1
  Vec3 up = Vec3::UnitZ();            ///< against the gravity
  std::optional<double> ground = {};  ///< height along `up`, in mesh coordinates; none: no ground
};

/// How a surface presses on obstacles, and where these are.
struct ContactState {
  std::vector<Mat4> placements;  ///< of the functions' cubes, in the surface's
  struct Pressure {
    Index row;
    Index surface;
    double pressure;
    Vec3 anchor;  ///< where friction holds it
  };
  std::vector<Pressure> pressures;  ///< of what touches
  struct Inside {
    Index row;
    Index surface;
    Vec3 seen;
    double clear;  ///< distance there; −∞: it stays inside, where an obstacle crosses the surface
  };
  std::vector<Inside> inside;  ///< where what may be inside was last seen outside
  /// Of each surface, the samples that it crosses at or beside; empty: none.
  std::vector<std::vector<bool>> crossed;
};

/// Where a body is and how it moves: all that the next step depends on beside its handles' targets.
struct MotionState {
  RowMatrix<double> coefficients;   ///< (size,3) of the radial basis
  RowMatrix<double> velocities;     ///< (size,3) of these, a second
  RowMatrix<double> accelerations;  ///< (size,3), a second²; empty: not known
  std::vector<Mat4> motions;        ///< of the handles, in cube coordinates; empty: not known
  ContactState contact = {};
};

}  // namespace arapfields
