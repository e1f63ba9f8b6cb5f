// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <optional>

#include "energies/body.h"
#include "energies/external_energy.h"
#include "energies/locality.h"
#include "energies/stance.h"
#include "energies/style.h"
#include "energies/term.h"
#include "options/surface.h"

namespace arapfields {

/// What the terms of a solve's objective that depend on jets are made of, and their weights:
///   rigidity·mean w(stretch + λ·bend) + gauss·style + keep_stance·stance + barrier·fold_barrier + locality +
///   body + external + further.
struct JetTermSettings {
  double rigidity = 1.0;
  bool bends = true;     ///< false: λ is 0 everywhere
  StyleAtSamples style;  ///< its weights: one a sample, or empty: all 1
  double gauss = 0.0;    ///< weight of the style
  Stance stance;         ///< of the samples
  double keep_stance = 0.0;
  double barrier = 0.0;
  double barrier_threshold = SurfaceOptions().barrier_threshold;
  Locality locality = Locality::none();  ///< of the samples
  std::optional<Body<double>> body;      ///< external forces on it
  ExternalEnergies external;
  double external_weight = 1.0;  ///< of the external energies and the further terms
  JetTerms further;              ///< terms of a caller's own
};

/// The list of the library's own terms that act, and after them the caller's.
struct JetTermList {
  explicit JetTermList(const JetTermSettings& settings);
  void set_batch(const TermBatch& batch) const;
  JetOrder order() const { return std::max(highest_order(own), highest_order(callers)); }

  JetTerms own;      ///< the first one is ARAP
  JetTerms callers;  ///< external energies and further terms
};

}  // namespace arapfields
