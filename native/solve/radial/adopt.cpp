// SPDX-License-Identifier: GPL-3.0-or-later
// Fitting another field, and adding energy samples where the field folds.
#include <cmath>

#include "core/parallel.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"
#include "solve/radial/state.h"

namespace arapfields {
namespace {

double dot(const RowMatrix<double>& a, const RowMatrix<double>& b) { return a.cwiseProduct(b).sum(); }

/// The single-precision measurements of another field, whose frame may differ (symmetry changes the frame).
VectorF measured(RadialState& s, const DeformationField& field) {
  const Frame &from = field.frame(), &own = s.problem.frame();
  const auto jets_at = [&](const Points& points, JetOrder order) {
    RowMatrix<double> jets(columns(order) * points.rows(), 3);
    const JetView<double> view{jets.data(), points.rows(), order};
    field.evaluate(from == own ? points : from.to_cube(own.to_mesh(points)), view);
    if (from != own) jets.topRows(points.rows()) = own.to_cube(from.to_mesh(jets.topRows(points.rows())));
    if (order == JetOrder::second) jets.bottomRows(6 * points.rows()) *= own.scale / from.scale;
    return jets;
  };
  return s.fast.objective.latest()->measured(jets_at);
}

}  // namespace

/// Least-squares fit in the norm of the quadratic model (RadialObjective::weighted), by preconditioned
/// conjugate gradients (Nocedal & Wright 2006, algorithm 5.3). Rounding errors of single precision grow with
/// the iterations, so they end when the energy no longer decreases.
void RadialSolver::adopt(const DeformationField& field, const ContactReport& contact) {
  constexpr int rounds = 8;
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.options.threads);
  s.contact.release();
  s.precondition(0.0);
  const RadialObjective<float>& objective = s.objective(s.fast);
  s.invalidate_history();
  RowMatrix<double>& coefficients = s.shape.coefficients;
  VectorF u, du;
  objective.measure(coefficients, u);
  double value = objective.value(u, nullptr);
  RowMatrix<double> residual = objective.pull_back(objective.weighted(measured(s, field) - u));
  RowMatrix<double> image = objective.precondition(residual), direction = image;
  double square = dot(residual, image);
  for (int round = 0; round < rounds && square > 0.0; ++round) {
    objective.measure(direction, du);
    const RowMatrix<double> product = objective.pull_back(objective.weighted(du));
    const double step = square / dot(direction, product);
    u += static_cast<float>(step) * du;
    const double next_value = objective.value(u, nullptr);
    if (!(next_value < value)) break;
    value = next_value;
    coefficients += step * direction;
    residual -= step * product;
    image = objective.precondition(residual);
    const double next = dot(residual, image);
    direction = image + next / square * direction;
    square = next;
  }
  s.dynamics.zero_velocity(motions_of(s.handles.bound()));
  s.report.contact = contact;
  s.tried = {s.handles.pairs().targets, coefficients};
  s.contact.begin(s.problem.basis.identity());  // the other field may have crossed a sheet
}

Index RadialSolver::add_fold_samples(double barrier, const DeformationField& now, const MeshPlaces& places) {
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.options.threads);
  const std::vector<Index>& chosen = s.problem.energy_samples;
  // Samples that are no energy samples, in spatial order.
  std::vector<bool> is_chosen(static_cast<std::size_t>(s.problem.samples.size()), false);
  for (const Index i : chosen) is_chosen[static_cast<std::size_t>(i)] = true;
  std::vector<Index> unseen;
  for (const std::uint32_t i : s.problem.shape->order)
    if (!is_chosen[i]) unseen.push_back(i);
  // Those at which the field folds, or nearly does.
  const Index count = static_cast<Index>(unseen.size());
  JetBlock<double> jets(count, JetOrder::first);
  now.evaluate(rows_of(s.problem.surface(), unseen), jets.view());
  Index folded = 0;
  std::vector<Index> added;
  for (Index p = 0; p < count; ++p) {
    Mat3 jacobian;
    for (int k = 0; k < 3; ++k) jacobian.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), p));
    const double determinant = jacobian.determinant();
    if (determinant <= 0.0) ++folded;
    if (determinant < s.problem.options.surface.barrier_threshold)
      added.push_back(unseen[static_cast<std::size_t>(p)]);
  }
  const double seen_folds = s.report.distortion.flipped_share * static_cast<double>(chosen.size());
  folded += static_cast<Index>(std::ceil(seen_folds)) + places.points.rows();
  if (folded == 0) return 0;
  s.problem.options.surface.barrier = barrier;
  if (places.points.rows() > 0) {
    const Index before = s.problem.samples.size();
    s.problem.add_samples(places);
    for (Index row = before; row < s.problem.samples.size(); ++row) added.push_back(row);
    if (s.handles.any()) s.handles.set(std::vector<Handle>(handles()));  // which may hold some of them
  }
  s.problem.add_energy_samples(added);
  if (places.points.rows() > 0)  // where hardly anything held the field
    s.stiffness.update(s.handles.bound());
  else
    s.stiffness.add_samples(s.handles.bound());
  return folded;
}

}  // namespace arapfields
