// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "energies/external_energy.h"
#include "optimize/iteration.h"

namespace arapfields {

/// What a caller adds to a solve: energies at its samples, and an observer. The observer gets the weighted
/// terms after each step; it ends the solve by returning false.
struct RadialHooks {
  ExternalEnergies energies;
  double weight = 1.0;  ///< of the energies
  std::function<bool(const std::vector<LossTerm>&)> observer;
};

}  // namespace arapfields
