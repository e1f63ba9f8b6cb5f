// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>

#include "energies/stance.h"
#include "fields/radial_basis.h"

namespace arapfields {

/// mean ‖J‖² + bending · mean ‖D‖² over (at most a thousand of) the samples, as a matrix of the basis: what
/// of the energy's Hessian depends on the rest surface alone.
RowMatrix<double> surface_stiffness(const RadialBasis& basis, PointsIn samples, double bending);

/// Rows (n, size) of values at the samples and weights (n) with which Σ_p weights_p values_pᵀ values_p is the
/// Hessian of half the stance's energy, its upward part spread over all directions: for at most a thousand of
/// the samples.
std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance);

/// L⁻¹ for L Lᵀ = stiffness + Σ_p weights_p values_pᵀ values_p + a ridge for what rounding leaves singular.
RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights);

}  // namespace arapfields
