// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_objective.h"

#include "core/dense.h"
#include "core/errors.h"

namespace arapfields {
namespace {

/// Pull of each bump's coefficient towards zero: removes what no sample can see, and no more.
constexpr double bump_weight = 1e-10;
/// Added to the preconditioner's diagonal, as a share of its mean: bumps overlap so much that the matrix is
/// singular to rounding.
constexpr double preconditioner_ridge = 1e-9;
constexpr Index preconditioner_samples = 1000;

/// mean ‖J‖² + bending · mean ‖D‖² as a matrix of the basis.
RowMatrix<double> surface_stiffness(const RadialSites& samples, double bending) {
  const Index stride = std::max<Index>(1, samples.size() / preconditioner_samples);
  RowMatrix<double> rows = samples.rows(JetOrder::second, stride);
  const Index taken = rows.rows() / 10;
  rows.middleRows(4 * taken, 3 * taken) *= std::sqrt(bending);
  rows.middleRows(7 * taken, 3 * taken) *= std::sqrt(2.0 * bending);
  RowMatrix<double> result(rows.cols(), rows.cols());
  const auto used = rows.bottomRows(9 * taken);
  gemm<double>(Transpose::yes, Transpose::no, 1.0 / static_cast<double>(taken), used, used, 0.0, result);
  return result;
}

}  // namespace

LiveObjective::LiveObjective(const RadialBasis& basis, PointsIn samples, double bending, double handle_weight)
    : bumps_(basis.bumps()),
      bending_(bending),
      handle_weight_(handle_weight),
      samples_(basis, samples),
      stiffness_(surface_stiffness(samples_, bending)),
      basis_(basis) {}

void LiveObjective::set_handles(HandleBatch<double> pairs) {
  pairs_ = std::move(pairs);
  handle_basis_ = RadialSites(basis_, pairs_.sources).rows(JetOrder::value);
  RowMatrix<double> matrix = stiffness_;
  const RowMatrix<double> weighted =
      (handle_weight_ * pairs_.weights).cwiseSqrt().asDiagonal() * handle_basis_;
  gemm<double>(Transpose::yes, Transpose::no, 1.0, weighted, weighted, 1.0, matrix);
  // Without handles (a style alone) translations are free: the affine part is held as lightly as bumps are.
  matrix.diagonal().array() += preconditioner_ridge * matrix.diagonal().mean() + bump_weight;
  factor_ = cholesky<double>(matrix);
}

void LiveObjective::set_targets(Points targets) {
  require(targets.rows() == pairs_.sources.rows(), "targets", std::to_string(targets.rows()) + " rows",
          std::to_string(pairs_.sources.rows()) + " are needed");
  pairs_.targets = std::move(targets);
}

void LiveObjective::set_style(std::optional<LiveStyle> style) { style_ = std::move(style); }

void LiveObjective::measure(const RowMatrix<double>& c, Vector& u) const {
  u.resize(bump_offset() + 3 * bumps_);
  samples_.evaluate(c, {u.data(), samples_.size(), JetOrder::second});
  Eigen::Map<RowMatrix<double>> values(u.data() + handle_offset(), pairs_.sources.rows(), 3);
  if (values.rows() > 0) gemm<double>(Transpose::no, Transpose::no, 1.0, handle_basis_, c, 0.0, values);
  u.tail(3 * bumps_) = Eigen::Map<const Vector>(c.data(), 3 * bumps_);
}

LiveTerms LiveObjective::evaluate(const Vector& u, Vector* cotangents) const {
  if (cotangents != nullptr) cotangents->setZero(u.size());
  double* out = cotangents != nullptr ? cotangents->data() : nullptr;
  const auto at = [&](Index offset) { return out != nullptr ? out + offset : nullptr; };
  const Index n = samples_.size();
  LiveTerms terms;
  terms.arap = arap_energy<double>(jets(u), bending_, 1.0, {out, n, JetOrder::second});
  const Index pairs = pairs_.sources.rows();
  terms.handles = handle_energy<double>({u.data() + handle_offset(), pairs, JetOrder::value}, pairs_,
                                        handle_weight_, {at(handle_offset()), pairs, JetOrder::value});
  if (style_)
    terms.gauss = gauss_energy<double>(jets(u), style_->normals, style_->sample_weights, style_->preference,
                                       style_->weight, {out, n, JetOrder::second});
  return terms;
}

HandleError LiveObjective::handle_distance(const Vector& u) const {
  const Eigen::Map<const Points> values(u.data() + handle_offset(), pairs_.sources.rows(), 3);
  if (values.rows() == 0) return {};
  const Vector distance = (values - pairs_.targets).rowwise().norm();
  return {distance.dot(pairs_.weights) / pairs_.weights.sum(), distance.maxCoeff()};
}

double LiveObjective::value(const Vector& u, Vector* cotangents) const {
  const LiveTerms terms = evaluate(u, cotangents);
  const auto bumps = u.tail(3 * bumps_);
  if (cotangents != nullptr) cotangents->tail(3 * bumps_) = 2.0 * bump_weight * bumps;
  return terms.arap.stretch + bending_ * terms.arap.bend + handle_weight_ * terms.handles +
         (style_ ? style_->weight * terms.gauss : 0.0) + bump_weight * bumps.squaredNorm();
}

RowMatrix<double> LiveObjective::pull_back(const Vector& cotangents) const {
  RowMatrix<double> gradient = RowMatrix<double>::Zero(bumps_ + 4, 3);
  samples_.pull_back({cotangents.data(), samples_.size(), JetOrder::second}, gradient);
  const Eigen::Map<const RowMatrix<double>> values(cotangents.data() + handle_offset(), pairs_.sources.rows(),
                                                   3);
  if (values.rows() > 0)
    gemm<double>(Transpose::yes, Transpose::no, 1.0, handle_basis_, values, 1.0, gradient);
  Eigen::Map<Vector>(gradient.data(), 3 * bumps_) += cotangents.tail(3 * bumps_);
  return gradient;
}

RowMatrix<double> LiveObjective::precondition(const RowMatrix<double>& gradient) const {
  return 0.5 * cholesky_solve<double>(factor_, gradient);
}

}  // namespace arapfields
