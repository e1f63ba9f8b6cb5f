// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/contact_rows.h"

namespace arapfields {

/// What planes that press add to a preconditioner (L Lᵀ)⁻¹, by the Sherman–Morrison–Woodbury formula: each is
/// stiff along its normal alone, so that the surface slides freely. For at most some hundreds of them.
class ContactStiffness {
 public:
  ContactStiffness() = default;
  ContactStiffness(const RadialBasis& basis, const ContactSet& set, PointsIn places,
                   const TallMatrix<float>& inverse_factor);
  /// y ← (I + L⁻¹ Σ B L⁻ᵀ)⁻¹ y for y = L⁻¹ gradient (size,3).
  void apply(PointsF& y) const;

 private:
  ContactRows rows_;
  RowMatrix<double> factor_;  // Cholesky factor of 2/(stiffness·share) + their compliance
};

}  // namespace arapfields
