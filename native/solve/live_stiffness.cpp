// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_stiffness.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/dense.h"
#include "core/parallel.h"
#include "fields/radial_evaluator.h"

namespace arapfields {
namespace {

/// Centers overlap so much that the matrix is singular to rounding.
constexpr double ridge = 1e-9;
/// Samples a center, and at least: a sample has nine derivatives.
constexpr double samples_a_center = 1.5;
constexpr Index least_samples = 1000;
/// Samples that a stance is held at.
constexpr Index stance_samples = 1000;
/// Parts that are summed on their own: the result does not depend on the number of threads.
constexpr Index parts = 4;

/// Adds the products of the block's functions' derivatives, weighted, at its points: rows and columns of
/// `sum` are the centers, then the three linear functions.
void add_block(const RadialBlock<double>& block, const double* roots, Index points, RowMatrix<double>& sum,
               std::vector<double>& jets, RowMatrix<double>& rows, RowMatrix<double>& products) {
  const Index active = block.active_count, size = active + 3, centers = sum.rows() - 4;
  jets.resize(static_cast<std::size_t>(active * 10 * 16));
  ARAPFIELDS_DISPATCH(radial_rows(block, 10, jets.data()));
  rows.setZero(9 * points, size);
  for (Index a = 0; a < active; ++a)
    for (int c = 1; c < 10; ++c) {
      const double shared = c < 7 ? 1.0 : std::sqrt(2.0);  // mixed derivatives stand for two
      for (Index p = 0; p < points; ++p)
        rows((c - 1) * points + p, a) =
            jets[static_cast<std::size_t>((a * 10 + c) * 16 + p)] * (c < 4 ? 1.0 : shared * roots[p]);
    }
  for (int k = 0; k < 3; ++k) rows.block(k * points, active + k, points, 1).setOnes();
  products.resize(size, size);
  gemm<double>(Transpose::yes, Transpose::no, 1.0, rows, rows, 0.0, products);
  const auto place = [&](Index i) { return i < active ? Index{block.active[i]} : centers + 1 + i - active; };
  for (Index i = 0; i < size; ++i) {
    double* to = sum.row(place(i)).data();
    for (Index j = 0; j < size; ++j) to[place(j)] += products(i, j);
  }
}

}  // namespace

RowMatrix<double> stiffness_matrix(const RadialBasis& basis, PointsIn samples, const Vector& bending) {
  const Index wanted = std::max(least_samples, static_cast<Index>(samples_a_center * basis.center_count()));
  const Index taken = std::min<Index>(samples.rows(), wanted);
  Points some(taken, 3);
  Vector roots(taken);
  for (Index i = 0; i < taken; ++i) {
    some.row(i) = samples.row(i * samples.rows() / taken);
    roots[i] = std::sqrt(bending[i * samples.rows() / taken]);
  }
  const RadialEvaluator<double> sites(basis, some);
  std::vector<RowMatrix<double>> sums(parts);
  const Index blocks = (taken + 15) / 16;
  parallel_for(0, parts, 1, [&](Index first, Index last) {
    std::vector<double> jets;
    RowMatrix<double> rows, products;
    for (Index part = first; part < last; ++part) {
      auto& sum = sums[static_cast<std::size_t>(part)];
      sum.setZero(basis.size(), basis.size());
      for (Index b = part * blocks / parts; b < (part + 1) * blocks / parts; ++b)
        add_block(sites.block(b), &roots[16 * b], std::min<Index>(16, taken - 16 * b), sum, jets, rows,
                  products);
    }
  });
  for (std::size_t part = 1; part < sums.size(); ++part) sums[0] += sums[part];
  return sums[0] / static_cast<double>(taken);
}

std::pair<RowMatrix<double>, Vector> stance_rows(const RadialBasis& basis, PointsIn samples,
                                                 const Stance& stance) {
  const Index taken = std::min<Index>(samples.rows(), stance_samples);
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
