// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_stiffness.h"

#include <cmath>

#include "core/dense.h"
#include "fields/radial_evaluator.h"

namespace arapfields {
namespace {

/// Centers overlap so much that the matrix is singular to rounding.
constexpr double ridge = 1e-9;
constexpr Index most_samples = 1000;

}  // namespace

RowMatrix<double> surface_stiffness(const RadialBasis& basis, PointsIn samples, double bending) {
  const Index taken = std::min<Index>(samples.rows(), most_samples);
  Points some(taken, 3);
  for (Index i = 0; i < taken; ++i) some.row(i) = samples.row(i * samples.rows() / taken);
  RowMatrix<double> rows = radial_rows(basis, some, JetOrder::second);
  rows.middleRows(4 * taken, 3 * taken) *= std::sqrt(bending);
  rows.middleRows(7 * taken, 3 * taken) *= std::sqrt(2.0 * bending);
  RowMatrix<double> result(rows.cols(), rows.cols());
  const auto used = rows.bottomRows(9 * taken);
  gemm<double>(Transpose::yes, Transpose::no, 1.0 / static_cast<double>(taken), used, used, 0.0, result);
  return result;
}

std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance) {
  const Index taken = std::min<Index>(samples.rows(), most_samples);
  Points some(taken, 3);
  Vector weights(taken);
  for (Index i = 0; i < taken; ++i) {
    const Index pick = i * samples.rows() / taken;
    some.row(i) = samples.row(pick);
    weights[i] = stance.scale * (1.0 + stance.ground[pick] / 3.0) / static_cast<double>(taken);
  }
  RowMatrix<double> rows = radial_rows(basis, some, JetOrder::value);
  rows.rowwise() -= (weights.transpose() * rows / weights.sum()).eval();
  return {std::move(rows), std::move(weights)};
}

RowMatrix<double> inverse_factor(RowMatrix<double> stiffness, const RowMatrix<double>& values,
                                 const Vector& weights) {
  const RowMatrix<double> weighted = weights.cwiseSqrt().asDiagonal() * values;
  gemm<double>(Transpose::yes, Transpose::no, 1.0, weighted, weighted, 1.0, stiffness);
  stiffness.diagonal().array() += ridge * stiffness.diagonal().mean();
  return lower_inverse<double>(cholesky<double>(stiffness));
}

}  // namespace arapfields
