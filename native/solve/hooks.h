// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "energies/external_energy.h"
#include "energies/term.h"
#include "optimize/iteration.h"
#include "solve/contact/contact.h"

namespace arapfields {

/// Optional additions to deform and stylize.
struct SolveHooks {
  ExternalEnergies energies;            ///< energies that join the loss
  IterationObserver observer;           ///< called after each iteration
  std::optional<Contact> contact = {};  ///< contact constraints
  JetTerms terms = {};                  ///< further terms of the loss
  bool adds_terms() const { return !energies.empty() || !terms.empty(); }
};

}  // namespace arapfields
