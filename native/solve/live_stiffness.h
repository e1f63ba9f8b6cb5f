// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/radial_basis.h"

namespace arapfields {

/// mean ‖J‖² + bending · mean ‖D‖² over (at most a thousand of) the samples, as a matrix of the basis: what
/// of the energy's Hessian depends on the rest surface alone.
RowMatrix<double> surface_stiffness(const RadialBasis& basis, PointsIn samples, double bending);

/// L⁻¹ for L Lᵀ = stiffness + Σ_p weights_p values_pᵀ values_p + a ridge for what rounding leaves singular.
RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights);

}  // namespace arapfields
