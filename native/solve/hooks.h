// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "energies/external_energy.h"
#include "optimize/iteration.h"
#include "solve/contact.h"

namespace arapfields {

/// Optional additions to deform and stylize.
struct SolveHooks {
  ExternalEnergies energies;            ///< terms that join the loss
  IterationObserver observer;           ///< called after each iteration
  std::optional<Contact> contact = {};  ///< contact constraints
};

}  // namespace arapfields
