// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"
#include "energies/arap.h"
#include "energies/distortion.h"
#include "optimize/iteration.h"
#include "solve/contact/contact.h"

namespace arapfields {

/// Energies and errors after a solve, at its energy samples. The stretch and the energy are pure numbers, the
/// bend is in 1/cube units², lengths are in mesh units.
struct RadialReport {
  ArapValue arap;            ///< arap.energy with the samples' own stiffness
  double value = 0.0;        ///< the objective
  double handle_mean = 0.0;  ///< distance to the targets
  double handle_max = 0.0;
  std::vector<LossTerm> terms;       ///< the weighted terms of the objective
  std::optional<double> preference;  ///< preference_of() a style, where there is one
  double kinetic = 0.0;              ///< kinetic energy, in the unit of `value`; 0 after a solve
  double speed = 0.0;                ///< root mean square over the samples, mesh units a second
  Distortion distortion;
  ContactReport contact;
  Index iterations = 0;
  Index evaluations = 0;  ///< of the objective
  bool converged = false;
  double setup_seconds = 0.0;
  double seconds = 0.0;
  std::vector<std::string> warnings;  ///< sentences on folds and far targets
};

}  // namespace arapfields
