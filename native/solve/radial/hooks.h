// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "energies/external_energy.h"
#include "energies/term.h"
#include "optimize/iteration.h"

namespace arapfields {

/// Gets the weighted terms after each iteration, and ends the solve by returning false.
using RadialObserver = std::function<bool(const std::vector<LossTerm>&)>;

/// Optional additions to a solve: external energies and terms at its samples, and an observer.
struct RadialHooks {
  ExternalEnergies energies;
  double weight = 1.0;  ///< of the energies and terms
  RadialObserver observer;
  JetTerms terms = {};
  bool adds_terms() const { return !energies.empty() || !terms.empty(); }
};

}  // namespace arapfields
