// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/tall_product.h"
#include "energies/contact.h"
#include "fields/radial_basis.h"
#include "solve/radial/contact_terms.h"

namespace arapfields {

/// The Jacobian J (m, 3·size) of the gaps of m contact planes by the field's coefficients, in preconditioned
/// coordinates: the quasi-Newton model has the Hessian 2 L Lᵀ for each coordinate. Row i is the outer product
/// of rows_i and normals_i.
struct ContactRows {
  RowMatrix<float> rows;      ///< (m, size) L⁻¹ b, b the basis functions' values at the plane's point
  RowMatrix<double> normals;  ///< (m,3)

  Index size() const { return normals.rows(); }
  /// Appends planes of a set, each with a unit vector of `along` (m,3) in place of its normal.
  void add(const RadialBasis& basis, const ContactSet& set, const std::vector<const ContactPlane*>& planes,
           const RowMatrix<double>& along, const TallMatrix<float>& inverse_factor);
  /// The lower triangle of J Jᵀ = rows·rowsᵀ ∘ normals·normalsᵀ (m, m), twice the compliance: gaps per force.
  RowMatrix<double> compliance() const;
  /// J y (m): the components along the normals of rows·y, for y (size,3).
  Vector along(const PointsF& y) const;
  /// Jᵀ forces (size,3), for forces (m) along the normals.
  PointsF pull(const Vector& forces) const;
};

/// Solves the linear complementarity problem λ ≥ 0, w = M λ + q ≥ 0, λ·w = 0, given the lower triangle of a
/// symmetric positive semidefinite M; 1e-4 of its largest diagonal entry is added to the diagonal. If the
/// problem is infeasible, λ is the iterate after a bounded number of sweeps.
ARAPFIELDS_EXPORT_TO_TESTS Vector solve_complementarity(const RowMatrix<double>& lower, const Vector& q);

}  // namespace arapfields
