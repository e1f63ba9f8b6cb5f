// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"

namespace arapfields {

class JetTerm;

/// Determinants and stretches of a deformation over the points of its jets: how far it is from folding.
struct Distortion {
  double min_determinant = 1.0;  ///< smallest det J
  double flipped_share = 0.0;    ///< share of points with det J ≤ 0
  double max_stretch = 1.0;      ///< largest singular value of J
  double min_stretch = 1.0;      ///< smallest singular value of J
};

/// Jets of at least first order; no points: the identity's measures.
template <class Scalar>
ARAPFIELDS_EXPORT Distortion distortion(JetView<const Scalar> jets);

/// A barrier against folds: mean of max(0, 1 − det J/threshold)², 0 where det J ≥ threshold > 0. Adds weight
/// times its cotangents (data may be null).
template <class Scalar>
ARAPFIELDS_EXPORT double fold_barrier(JetView<const Scalar> jets, double threshold, double weight,
                                      JetView<Scalar> cotangents);

/// weight · fold_barrier() of a batch.
std::shared_ptr<JetTerm> barrier_term(double threshold, double weight);

}  // namespace arapfields
