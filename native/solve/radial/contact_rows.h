// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/tall_product.h"
#include "energies/contact.h"
#include "fields/radial_basis.h"
#include "solve/radial/contact_terms.h"

namespace arapfields {

/// What planes feel of a field, where the energy is the quasi-Newton model with the matrix 2 L Lᵀ for each
/// coordinate.
struct ContactRows {
  RowMatrix<float> rows;      ///< (m, size) L⁻¹ b of each plane's basis values b
  RowMatrix<double> normals;  ///< (m,3)

  Index size() const { return normals.rows(); }
  /// Adds planes of a set, each along a unit vector.
  void add(const RadialBasis& basis, const ContactSet& set, const std::vector<const ContactPlane*>& planes,
           const RowMatrix<double>& along, const TallMatrix<float>& inverse_factor);
  /// rows·rowsᵀ ∘ normals·normalsᵀ: twice how far (m) planes give way to forces (m). The lower triangle.
  RowMatrix<double> compliance() const;
  /// The parts along the normals of rows·y, for y (size,3).
  Vector along(const PointsF& y) const;
  /// rowsᵀ of forces (m) along the normals.
  PointsF pull(const Vector& forces) const;
};

/// The linear complementarity problem: λ ≥ 0 with w = M λ + q ≥ 0 and λ·w = 0, for the lower triangle of a
/// symmetric, positive semidefinite M, to which a ten-thousandth of its largest diagonal entry is added.
/// Where no motion satisfies all planes, λ is what a bounded number of sweeps reach.
ARAPFIELDS_EXPORT_TO_TESTS Vector solve_complementarity(const RowMatrix<double>& lower, const Vector& q);

}  // namespace arapfields
