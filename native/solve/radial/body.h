// SPDX-License-Identifier: GPL-3.0-or-later
// What a live solver knows of its surface as a body that moves.
#pragma once

#include <optional>
#include <vector>

#include "solve/radial/handle_motion.h"
#include "solve/radial/secondary_motion.h"

namespace arapfields {

struct RadialBody {
  std::optional<SecondaryMotion> asked;  // `up` of length 1
  Vector masses;                         // of the samples that the energy sees
  RowMatrix<double> velocities;          // of the coefficients; empty: at rest
  RowMatrix<double> accelerations;       // of the coefficients, by the last step's forces; empty: not known
  RowMatrix<double> gram, smoothing;     // what smooth() takes for steps of the length `smoothed`
  double smoothed = 0.0;
  std::vector<Mat4> motions;      // of the handles where the last step or solve ended; empty: not known
  double factored_inertia = 0.0;  // in the preconditioner

  /// Mass at strength 1, in seconds²/cube unit² against the energy of the surface.
  static constexpr double unit_mass = 1.0 / 300.0;
  bool has_mass() const { return asked && asked->options.strength > 0.0; }
  double mass() const { return unit_mass * asked->options.strength; }
};

}  // namespace arapfields
