// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_rows.h"

#include <algorithm>

#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Most changes of the active set, and Gauss–Seidel sweeps if it has not settled after them.
constexpr int most_changes = 30, sweeps = 200;
/// Regularisation of the diagonal, as a fraction of its largest entry: near-parallel planes share their load.
constexpr double evenly = 1e-4;

}  // namespace

void ContactRows::add(const RadialBasis& basis, const ContactSet& set,
                      const std::vector<const ContactPlane*>& planes, const RowMatrix<double>& along,
                      const TallMatrix<float>& inverse_factor) {
  const Index count = std::ssize(planes), before = size();
  if (count == 0) return;
  std::vector<Index> first, carrying, carriers;
  for (Index i = 0; i < count; ++i) {
    const ContactPlane& plane = *planes[static_cast<std::size_t>(i)];
    first.push_back(plane.first);
    if (plane.second >= 0) carrying.push_back(i), carriers.push_back(plane.second);
  }
  const auto values_at = [&](const std::vector<Index>& places) {
    const Points embedded = set.embedded.rows() > 0 ? rows_of(set.embedded, places) : Points(0, 3);
    return radial_rows(basis, rows_of(set.places, places), JetOrder::value,
                       embedded.rows() > 0 ? &embedded : nullptr);
  };
  RowMatrix<double> values = values_at(first);
  if (!carriers.empty()) values(carrying, Eigen::all) -= values_at(carriers);
  rows.conservativeResize(before + count, basis.size());
  normals.conservativeResize(before + count, 3);
  normals.bottomRows(count) = along;
  for (Index i = 0; i < count; i += 3) {
    const Index some = std::min<Index>(3, count - i);
    PointsF columns = PointsF::Zero(basis.size(), 3);
    columns.leftCols(some) = values.middleRows(i, some).transpose().cast<float>();
    rows.middleRows(before + i, some) = inverse_factor.times(columns).leftCols(some).transpose();
  }
}

RowMatrix<double> ContactRows::compliance() const {
  RowMatrix<float> products(size(), size());
  lower_gram<float>(Transpose::no, rows, 0.0f, products);
  return products.cast<double>().cwiseProduct(normals * normals.transpose());
}

Vector ContactRows::along(const PointsF& y) const {
  const PointsF moved = rows * y;
  return moved.cast<double>().cwiseProduct(normals).rowwise().sum();
}

PointsF ContactRows::pull(const Vector& forces) const {
  return rows.transpose() * (forces.asDiagonal() * normals).cast<float>();
}

/// The primal–dual active set method (Hintermüller, Ito & Kunisch 2002), then projected Gauss–Seidel if that
/// does not terminate.
Vector solve_complementarity(const RowMatrix<double>& lower, const Vector& q) {
  const Index n = q.size();
  RowMatrix<double> m = lower.selfadjointView<Eigen::Lower>();
  m.diagonal().array() += std::max(evenly * m.diagonal().maxCoeff(), 1e-30);
  std::vector<bool> active(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) active[static_cast<std::size_t>(i)] = q[i] < 0.0;
  Vector forces = Vector::Zero(n);
  for (int change = 0; change < most_changes; ++change) {
    std::vector<Index> rows;
    for (Index i = 0; i < n; ++i)
      if (active[static_cast<std::size_t>(i)]) rows.push_back(i);
    forces.setZero();
    if (!rows.empty()) {
      const RowMatrix<double> right = -entries_of(q, rows);
      const RowMatrix<double> found = cholesky_solve<double>(cholesky<double>(m(rows, rows)), right);
      for (std::size_t k = 0; k < rows.size(); ++k) forces[rows[k]] = found(static_cast<Index>(k), 0);
    }
    const Vector left = m * forces + q;
    bool changed = false;
    for (Index i = 0; i < n; ++i) {
      const bool next = active[static_cast<std::size_t>(i)] ? forces[i] > 0.0 : left[i] < 0.0;
      changed = changed || next != active[static_cast<std::size_t>(i)];
      active[static_cast<std::size_t>(i)] = next;
    }
    if (!changed) return forces;
  }
  forces = forces.cwiseMax(0.0);
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (Index i = 0; i < n; ++i)
      forces[i] = std::max(0.0, forces[i] - (m.row(i).dot(forces) + q[i]) / m(i, i));
  return forces;
}

}  // namespace arapfields
