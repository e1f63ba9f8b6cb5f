// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>

#include "core/task.h"
#include "energies/stance.h"
#include "fields/handle_blend.h"
#include "fields/radial_basis.h"

namespace arapfields {

/// mean w (‖J‖² + λ‖D‖²) over (some of) the samples, with each one's λ and w (empty: all 1), as a matrix of
/// the basis, of which the lower triangle is filled: what of the energy's Hessian depends on the rest surface
/// alone. An estimate, for preconditioners: a sample is asked for three mixtures of its derivatives. With
/// exact handles, of the functions times their blend's free weight.
RowMatrix<double> stiffness_matrix(const RadialBasis& basis, PointsIn samples, const Vector& bending,
                                   const Vector& weights, const Progress& progress = {},
                                   const HandleBlend* blend = nullptr);

/// Rows (n, size) of values at the samples and weights (n) with which Σ_p weights_p values_pᵀ values_p is the
/// Hessian of half the stance's energy, its upward part spread over all directions: for at most a thousand of
/// the samples.
std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance);

/// L⁻¹ for L Lᵀ = stiffness (its lower triangle) + Σ_p weights_p values_pᵀ values_p + a ridge for what
/// rounding leaves singular.
RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights);

}  // namespace arapfields
