// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"

namespace arapfields {

class JetTerm;

/// Means over the points of how far J is from a rotation and of how fast that rotation turns.
struct ArapValue {
  double stretch = 0.0;         ///< mean ‖J − R‖²_F
  double bend = 0.0;            ///< mean Σ_k ⟨∂_k R, ∂_k R Y⟩; 0 where the jets have no second derivatives
  double energy = 0.0;          ///< mean w (‖J − R‖² + bending·l·bend), with the points' own factors w and l
  double stretch_energy = 0.0;  ///< mean w ‖J − R‖², the stretch's part of it
};

/// Weights of single points: a factor on each point's energy, and one on its bending. Null: all 1.
template <class Scalar>
struct ArapFactors {
  const Scalar* weights = nullptr;  ///< (n) w
  const Scalar* bending = nullptr;  ///< (n) l
};

/// The as-rigid-as-possible energy of the jets at points of the rest surface (first order suffices when
/// `bending` is 0). R is the rotation closest to J, Y = RᵀJ; with D_k = ∂_k J, w_k = K⁻¹ axl(Rᵀ D_k),
/// K = tr(Y) I − Y, the bend is Σ_k axl(Rᵀ D_k)·w_k. Adds the cotangents of weight·energy to `cotangents`
/// (same count; its data may be null: values alone); without factors the energy is stretch + bending·bend.
/// K's eigenvalues are clamped to at least 0.01, so that reflected and collapsed Jacobians have finite values
/// and cotangents. The stretch is the paper's; the authors' package divides it by 3.
template <class Scalar>
ARAPFIELDS_EXPORT ArapValue arap_energy(JetView<const Scalar> jets, double bending, double weight,
                                        JetView<Scalar> cotangents, ArapFactors<Scalar> factors = {});

/// weight · mean w (stretch + λ·bend) of a batch, with parts "stretch" and "bend"; first order if it does not
/// `bend`.
std::shared_ptr<JetTerm> arap_term(double weight, bool bends);

}  // namespace arapfields
