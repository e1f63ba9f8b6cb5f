// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/contact_rows.h"

namespace arapfields {

/// Low-rank update of the preconditioner (L Lᵀ)⁻¹ by the Hessian of the active contact planes and friction,
/// with the Sherman–Morrison–Woodbury formula. A plane is stiff along its normal, and along its tangents only
/// where friction acts. An even selection stands for all planes where there are more than some hundreds.
class ContactStiffness {
 public:
  ContactStiffness() = default;
  ContactStiffness(const RadialBasis& basis, const ContactSet& set, PointsIn places,
                   const TallMatrix<float>& inverse_factor);
  /// y ← (I + L⁻¹ Σ B L⁻ᵀ)⁻¹ y for y = L⁻¹ gradient (size,3).
  void apply(PointsF& y) const;

 private:
  ContactRows rows_;
  RowMatrix<double> factor_;  // Cholesky factor of J Jᵀ + diag(2/(stiffness·share)), see ContactRows
};

}  // namespace arapfields
