// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/radial_basis.h"

namespace arapfields {

/// mean (‖J‖² + λ‖D‖²) over (some of) the samples, with each one's λ, as a matrix of the basis:
/// what of the energy's Hessian depends on the rest surface alone.
RowMatrix<double> stiffness_matrix(const RadialBasis& basis, PointsIn samples, const Vector& bending);

/// L⁻¹ for L Lᵀ = stiffness + Σ_p weights_p values_pᵀ values_p + a ridge for what rounding leaves singular.
RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights);

}  // namespace arapfields
