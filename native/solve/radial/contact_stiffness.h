// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/tall_product.h"
#include "energies/contact.h"
#include "fields/radial_basis.h"
#include "solve/radial/contact_terms.h"

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
  RowMatrix<float> rows_;      // (planes, size) L⁻¹ b of each plane's basis values b
  RowMatrix<double> normals_;  // (planes, 3)
  RowMatrix<double> factor_;   // Cholesky factor of 2/(stiffness·share) + rows·rowsᵀ ∘ normals·normalsᵀ
};

}  // namespace arapfields
