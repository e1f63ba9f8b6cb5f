// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"
#include "options/locality.h"

namespace arapfields {

class JetTerm;

/// How strongly samples stay where a motion of the whole takes them.
struct Locality {
  LocalityOptions options;         ///< weight w, limit c, smoothing ε
  Mat4 motion = Mat4::Identity();  ///< m
  Vector shares;                   ///< (n) factors of the samples, 0: such a one follows others; empty: all 1
  /// (n) sizes of the parts that the samples belong to, in cube units; empty: all 1, the size of the whole.
  Vector sizes = {};

  static Locality none() {
    Locality result;
    result.options.locality = 0.0;
    return result;
  }
  bool acts() const { return options.locality > 0.0; }
};

/// w · mean s c (1 − exp(−ρ/c)) with ρ = √(‖d‖² + ε²) − ε, d = (f(x) − m(x)) / size, and the samples' shares
/// s times their weights, of which more than 1 counts as 1: what is stiffer is not held back more. It grows
/// linearly from rest, so that most samples do not move at all, and ends at w c, so that it does not hold
/// back what has to go far. After Chen, Zheng & Wampler, "Local Deformation for Interactive Shape Editing"
/// (SIGGRAPH 2023), whose ℓ1 norm is clamped. Samples that are drawn anew have the share 1, or 0 where
/// `shares` are given.
std::shared_ptr<JetTerm> locality_term(Locality locality);

}  // namespace arapfields
