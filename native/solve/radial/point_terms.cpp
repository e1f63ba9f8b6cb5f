// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/point_terms.h"

#include "core/errors.h"

namespace arapfields {
namespace {

/// Weight of the ridge.
constexpr double coefficient_weight = 1e-10;

template <class Scalar>
Eigen::Map<const PointsOf<Scalar>> rows_at(const Scalar* u, Index count) {
  return {u, count, 3};
}
template <class Scalar>
Eigen::Map<PointsOf<Scalar>> rows_at(Scalar* u, Index count) {
  return {u, count, 3};
}
template <class Scalar>
Eigen::Map<const Eigen::VectorX<Scalar>> numbers_at(const Scalar* u, Index rows) {
  return {u, 3 * rows};
}
template <class Scalar>
Eigen::Map<Eigen::VectorX<Scalar>> numbers_at(Scalar* u, Index rows) {
  return {u, 3 * rows};
}

}  // namespace

template <class Scalar>
HandleTerm<Scalar>::HandleTerm(const HandleBatch<double>& pairs, const RowMatrix<double>& basis_values,
                               double weight)
    : sources_(pairs.sources),
      pairs_{pairs.sources.cast<Scalar>(), pairs.targets.cast<Scalar>(), pairs.weights.cast<Scalar>()},
      basis_values_(basis_values),
      weight_(weight) {}

template <class Scalar>
void HandleTerm<Scalar>::set_targets(PointsIn targets) {
  require(targets.rows() == rows(), "targets", std::to_string(targets.rows()) + " rows",
          std::to_string(rows()) + " are needed");
  pairs_.targets = targets.cast<Scalar>();
}

template <class Scalar>
void HandleTerm<Scalar>::measure(const RowMatrix<double>&, const PointsOf<Scalar>& rounded, Scalar* u) const {
  rows_at(u, rows()) = basis_values_.times(rounded);
}

template <class Scalar>
double HandleTerm<Scalar>::value(const Scalar* u, Scalar* cotangents) const {
  return weight_ * handle_energy<Scalar>({u, rows(), JetOrder::value}, pairs_, weight_,
                                         {cotangents, rows(), JetOrder::value});
}

template <class Scalar>
void HandleTerm<Scalar>::pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const {
  gradient += basis_values_.transpose_times(rows_at(cotangents, rows())).template cast<double>();
}

template <class Scalar>
void HandleTerm<Scalar>::model(const Scalar* u, Scalar* out) const {
  rows_at(out, rows()) = Scalar(2.0 * weight_) * (pairs_.weights.asDiagonal() * rows_at(u, rows()));
}

template <class Scalar>
void LinkTerm<Scalar>::measure(const RowMatrix<double>&, const PointsOf<Scalar>& rounded, Scalar* u) const {
  rows_at(u, rows()) = basis_values_.times(rounded);
}

template <class Scalar>
double LinkTerm<Scalar>::value(const Scalar* u, Scalar* cotangents) const {
  const auto apart = numbers_at(u, rows());
  if (cotangents != nullptr) numbers_at(cotangents, rows()) = Scalar(2.0) * apart;
  return static_cast<double>(apart.squaredNorm());
}

template <class Scalar>
void LinkTerm<Scalar>::pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const {
  gradient += basis_values_.transpose_times(rows_at(cotangents, rows())).template cast<double>();
}

template <class Scalar>
void LinkTerm<Scalar>::model(const Scalar* u, Scalar* out) const {
  numbers_at(out, rows()) = Scalar(2.0) * numbers_at(u, rows());
}

template <class Scalar>
void RidgeTerm<Scalar>::measure(const RowMatrix<double>&, const PointsOf<Scalar>& rounded, Scalar* u) const {
  numbers_at(u, rows()) = numbers_at(rounded.data(), rows());
}

template <class Scalar>
double RidgeTerm<Scalar>::value(const Scalar* u, Scalar* cotangents) const {
  const auto centers = numbers_at(u, rows());
  if (cotangents != nullptr) numbers_at(cotangents, rows()) = Scalar(2.0 * coefficient_weight) * centers;
  return coefficient_weight * static_cast<double>(centers.squaredNorm());
}

template <class Scalar>
void RidgeTerm<Scalar>::pull_back(const Scalar* cotangents, RowMatrix<double>& gradient) const {
  Eigen::Map<Vector>(gradient.data(), 3 * rows()) += numbers_at(cotangents, rows()).template cast<double>();
}

template class HandleTerm<float>;
template class HandleTerm<double>;
template class LinkTerm<float>;
template class LinkTerm<double>;
template class RidgeTerm<float>;
template class RidgeTerm<double>;

}  // namespace arapfields
