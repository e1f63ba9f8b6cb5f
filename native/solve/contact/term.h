// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/tall_product.h"
#include "fields/radial_basis.h"
#include "solve/contact/planes.h"
#include "solve/radial/point_terms.h"

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

/// Contact planes at the points of a ContactSet, which is borrowed.
template <class Scalar>
class ContactTerm final : public PointTerm<Scalar> {
 public:
  ContactTerm() = default;
  ContactTerm(const RadialBasis& basis, const ContactSet& contact);
  /// First trial step length of a line search (planes.h).
  double first_trial(const Scalar* u, const Scalar* du, double slope) const;

  Index rows() const override { return places_.size(); }
  void measure(const RowMatrix<double>& c, const PointsOf<Scalar>& rounded, Scalar* u) const override;
  RowMatrix<double> measure_field(const JetsAt& jets_at) const override;
  double value(const Scalar* u, Scalar* cotangents) const override;
  void pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const override;
  void model(const Scalar*, Scalar*) const override {}

 private:
  const ContactSet* planes_ = nullptr;
  RadialEvaluator<Scalar> places_;
};

}  // namespace arapfields
