// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "energies/external_energy.h"
#include "optimize/iteration.h"

namespace arapfields {

/// What joins a live solve: energies at its samples, and who is told of the weighted terms after each step
/// and ends the solve by false.
struct RadialHooks {
  ExternalEnergies energies;
  double weight = 1.0;  ///< of the energies
  std::function<bool(const std::vector<LossTerm>&)> observer;
};

}  // namespace arapfields
