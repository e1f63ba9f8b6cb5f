// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/field.h"
#include "fields/influence.h"
#include "fields/radial_basis.h"

namespace arapfields {

/// A deformation as a sum of compactly supported radial basis functions and an affine map.
class ARAPFIELDS_EXPORT RadialField : public DeformationField {
 public:
  /// Coefficients (basis.size(), 3); throws InvalidInput for other shapes, non-finite numbers or radii ≤ 0.
  /// With an influence, points where it is 0 do not move, exactly.
  RadialField(RadialBasis basis, RowMatrix<double> coefficients,
              std::shared_ptr<const Influence> influence = nullptr);
  void evaluate(PointsIn points, JetView<double> out) const override;
  Points at(PointsIn mesh_points) const override;
  Points at_vertices(const TriangleMesh& mesh) const override;

  const RadialBasis& basis() const { return basis_; }
  const RowMatrix<double>& coefficients() const { return coefficients_; }
  const std::shared_ptr<const Influence>& influence() const { return influence_; }
  /// Whether the fields differ in their coefficients alone, so that they can share data precomputed at
  /// points.
  bool shares_places_with(const RadialField& other) const;

 private:
  void evaluate(PointsIn points, JetView<double> out, const std::vector<SurfaceSide>* sides) const;
  Points moved(PointsIn mesh_points, const std::vector<SurfaceSide>* sides) const;

  RadialBasis basis_;
  RowMatrix<double> coefficients_;
  std::shared_ptr<const Influence> influence_;
};

}  // namespace arapfields
