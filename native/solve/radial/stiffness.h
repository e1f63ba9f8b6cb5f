// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>

#include "energies/handles.h"
#include "energies/stance.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// The quadratic form mean w (‖J‖² + λ‖D‖²) over the samples, with each one's λ and w (empty: all 1), as a
/// matrix (size, size) of the basis, lower triangle filled: the part of the energy's Hessian that depends on
/// the rest surface alone. An estimate, for preconditioners: three linear combinations of the nine
/// derivatives at a sample stand for all. With exact handles, of the basis functions times the free weight.
RowMatrix<double> stiffness_matrix(const RadialBasis& basis, PointsIn samples, const Vector& bending,
                                   const Vector& weights, const Progress& progress = {},
                                   const HandleBlend* blend = nullptr);

/// Rows (n, size) of basis values and weights (n) such that Σ_p weights_p values_pᵀ values_p approximates
/// half the Hessian of the stance's energy, its vertical part averaged over directions; n is at most 1000.
std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance);

/// L⁻¹ for L Lᵀ = stiffness (its lower triangle) + Σ_p weights_p values_pᵀ values_p + a small multiple of the
/// identity, since rounding leaves the sum singular.
RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights);

/// λ and w at the energy samples, and their stiffness matrix, for the preconditioner.
class StiffnessTerms {
 public:
  explicit StiffnessTerms(const RadialProblem& problem) : problem_(problem) {}
  /// Updates λ and w for the samples' weights and the handles that may scale, and the matrix if they change.
  void update(const BoundHandles& handles, const Progress& progress = {});
  /// Updates λ and w for added energy samples. The matrix is kept: they change it little.
  void add_samples(const BoundHandles& handles);

  const Vector& weights() const { return weights_; }
  const Vector& bending() const { return bending_; }
  const RowMatrix<double>& matrix() const { return matrix_; }
  /// Revision of the matrix; λ and w change with it, or with the energy samples.
  Revision revision() const { return revision_; }

 private:
  const RadialProblem& problem_;
  Dependent<Vector, 1> own_bending_;  // λ of the energy samples, without their bend weights
  Vector weights_;                    // w of the energy samples; empty: all 1
  Vector bending_;                    // λ of the energy samples
  RowMatrix<double> matrix_;
  Revision revision_ = 0;
};

}  // namespace arapfields
