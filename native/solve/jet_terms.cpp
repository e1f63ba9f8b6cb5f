// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/jet_terms.h"

#include <algorithm>

#include "energies/arap.h"
#include "energies/distortion.h"

namespace arapfields {

JetTermList::JetTermList(const JetTermSettings& s) {
  own.push_back(arap_term(s.rigidity, s.bends));
  if (s.style.any() && s.gauss > 0.0) own.push_back(style_term(s.style, s.gauss));
  if (s.keep_stance > 0.0) own.push_back(stance_term(s.stance, s.keep_stance));
  if (s.barrier > 0.0) own.push_back(barrier_term(s.barrier_threshold, s.barrier));
  if (s.locality.acts()) own.push_back(locality_term(s.locality));
  if (s.body) own.push_back(body_term(*s.body));
  if (!s.external.empty()) callers.push_back(external_term(s.external, s.external_weight));
  for (const auto& term : s.further)
    callers.push_back(s.external_weight == 1.0 ? term : scaled(term, s.external_weight));
}

void JetTermList::set_batch(const TermBatch& batch) const {
  for (const auto& term : own) term->set_batch(batch);
  for (const auto& term : callers) term->set_batch(batch);
}

}  // namespace arapfields
