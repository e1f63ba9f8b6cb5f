// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/field.h"
#include "fields/radial_basis.h"

namespace arapfields {

/// A deformation as a weighted sum of compact centers and an affine map, with analytic jets.
class ARAPFIELDS_EXPORT RadialField : public DeformationField {
 public:
  /// Coefficients (basis.size(), 3); throws InvalidInput for other shapes, non-finite numbers or radii ≤ 0.
  RadialField(RadialBasis basis, RowMatrix<double> coefficients);
  void evaluate(PointsIn points, JetView<double> out) const override;

  const RadialBasis& basis() const { return basis_; }
  const RowMatrix<double>& coefficients() const { return coefficients_; }

 private:
  RadialBasis basis_;
  RowMatrix<double> coefficients_;
};

}  // namespace arapfields
