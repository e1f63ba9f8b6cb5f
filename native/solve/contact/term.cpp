// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/term.h"

#include <algorithm>

#include "sampling/sample_choice.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

using P = ContactParameters;

}  // namespace

template <class Scalar>
ContactTerm<Scalar>::ContactTerm(const RadialBasis& basis, const ContactSet& contact) : planes_(&contact) {
  if (!contact.planes.empty())
    places_ = RadialEvaluator<Scalar>(basis, contact.places, JetOrder::value,
                                      contact.embedded.rows() > 0 ? &contact.embedded : nullptr);
}

template <class Scalar>
double ContactTerm<Scalar>::first_trial(const Scalar* u, const Scalar* du, double slope) const {
  return contact_step<Scalar>(planes_->planes, planes_->stiffness, u, du, slope);
}

template <class Scalar>
void ContactTerm<Scalar>::measure(const RowMatrix<double>& c, const PointsOf<Scalar>&, Scalar* u) const {
  places_.evaluate(c, {u, rows(), JetOrder::value});
}

template <class Scalar>
RowMatrix<double> ContactTerm<Scalar>::measure_field(const JetsAt& jets_at) const {
  return jets_at(rows() > 0 ? planes_->places : Points(0, 3), JetOrder::value);
}

template <class Scalar>
double ContactTerm<Scalar>::value(const Scalar* u, Scalar* cotangents) const {
  return contact_energy<Scalar>(planes_->planes, planes_->stiffness, u, cotangents);
}

template <class Scalar>
void ContactTerm<Scalar>::pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const {
  places_.pull_back({cotangents, rows(), JetOrder::value}, gradient);
}

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
  m.diagonal().array() += std::max(P::complementarity_ridge * m.diagonal().maxCoeff(), 1e-30);
  std::vector<bool> active(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) active[static_cast<std::size_t>(i)] = q[i] < 0.0;
  Vector forces = Vector::Zero(n);
  for (int change = 0; change < P::most_changes; ++change) {
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
  for (int sweep = 0; sweep < P::complementarity_sweeps; ++sweep)
    for (Index i = 0; i < n; ++i)
      forces[i] = std::max(0.0, forces[i] - (m.row(i).dot(forces) + q[i]) / m(i, i));
  return forces;
}

ContactStiffness::ContactStiffness(const RadialBasis& basis, const ContactSet& set, PointsIn places,
                                   const TallMatrix<float>& inverse_factor) {
  struct Spring {
    const ContactPlane* plane;
    Vec3 along;
    double stiffness;  // times the area fraction
  };
  std::vector<Spring> springs;
  for (const ContactPlane& plane : set.planes) {
    if (plane.updated_pressure(plane.gap(places.data()), set.stiffness) <= 0.0) continue;
    springs.push_back({&plane, plane.normal, set.stiffness * plane.area});
    if (plane.friction <= 0.0) continue;
    const Vec3 first = plane.normal.unitOrthogonal();
    for (const Vec3& along : {first, Vec3(plane.normal.cross(first))})
      springs.push_back({&plane, along,
                         plane.friction / std::max(P::stuck, plane.slip(places.data()).norm()) * plane.area});
  }
  const Index all = std::ssize(springs), count = std::min<Index>(all, P::most_springs);
  if (count == 0) return;
  std::vector<const ContactPlane*> planes;
  RowMatrix<double> along(count, 3);
  Vector softness(count);
  for (Index i = 0; i < count; ++i) {
    const Spring& spring = springs[static_cast<std::size_t>(i * all / count)];
    planes.push_back(spring.plane);
    along.row(i) = spring.along.transpose();
    softness[i] = 2.0 * static_cast<double>(count) / (static_cast<double>(all) * spring.stiffness);
  }
  rows_.add(basis, set, planes, along, inverse_factor);
  RowMatrix<double> matrix = rows_.compliance();
  matrix.diagonal() += softness;
  factor_ = cholesky<double>(matrix);
}

void ContactStiffness::apply(PointsF& y) const {
  if (rows_.size() == 0) return;
  Vector pull = factor_.triangularView<Eigen::Lower>().solve(rows_.along(y));
  pull = factor_.transpose().triangularView<Eigen::Upper>().solve(pull);
  y -= rows_.pull(pull);
}

template class ContactTerm<float>;
template class ContactTerm<double>;

}  // namespace arapfields
