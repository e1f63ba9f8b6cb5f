// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "energies/external_energy.h"
#include "optimize/iteration.h"

namespace arapfields {

/// Optional additions to a solve: external energies at its samples, and an observer, which gets the weighted
/// terms after each iteration and ends the solve by returning false.
struct RadialHooks {
  ExternalEnergies energies;
  double weight = 1.0;  ///< of the energies
  std::function<bool(const std::vector<LossTerm>&)> observer;
};

}  // namespace arapfields
