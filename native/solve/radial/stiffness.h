// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>

#include "energies/handles.h"
#include "energies/stance.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// mean w (‖J‖² + λ‖D‖²) over the samples, with each one's λ and w (empty: all 1), as a matrix of
/// the basis, of which the lower triangle is filled: what of the energy's Hessian depends on the rest surface
/// alone. An estimate, for preconditioners: it takes three mixtures of the derivatives at a sample. With
/// exact handles, of the functions times their blend's free weight.
RowMatrix<double> stiffness_matrix(const RadialBasis& basis, PointsIn samples, const Vector& bending,
                                   const Vector& weights, const Progress& progress = {},
                                   const HandleBlend* blend = nullptr);

/// Rows (n, size) of values at the samples and weights (n) with which Σ_p weights_p values_pᵀ values_p is the
/// Hessian of half the stance's energy, its upward part spread over all directions: for at most a thousand of
/// the samples.
std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance);

/// L⁻¹ for L Lᵀ = stiffness (its lower triangle) + Σ_p weights_p values_pᵀ values_p + a ridge for what
/// rounding leaves singular.
RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights);

/// How stiff the surface is at the samples of the energy, and the matrix that preconditions solves with it.
class StiffnessTerms {
 public:
  explicit StiffnessTerms(const RadialProblem& problem) : problem_(problem) {}
  /// Follows other weights of the samples, and handles that may scale; the matrix is made anew where that
  /// changes anything.
  void update(const BoundHandles& handles, const Progress& progress = {});
  /// Follows energy samples that were added. The matrix stays: they add little to it.
  void add_samples(const BoundHandles& handles);

  const Vector& weights() const { return weights_; }
  const Vector& bending() const { return bending_; }
  const RowMatrix<double>& matrix() const { return matrix_; }
  /// Of the matrix; the weights and λ change with it, or with the energy samples.
  Revision revision() const { return revision_; }

 private:
  const RadialProblem& problem_;
  Dependent<Vector, 1> own_bending_;  // λ of the energy samples, without their bend weights
  Vector weights_;                    // w of these; empty: all 1
  Vector bending_;                    // λ of these
  RowMatrix<double> matrix_;
  Revision revision_ = 0;
};

}  // namespace arapfields
