// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/state.h"

#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "energies/alignment.h"
#include "sampling/sample_choice.h"
#include "solve/radial/rest_shape.h"
#include "solve/radial/stiffness.h"
#include "solve/radial/symmetry.h"
#include "solve/setup.h"
#include "solve/surface_stiffness.h"
#include "solve/warnings.h"

namespace arapfields {
namespace {

/// Samples × centers below which a step takes about a millisecond: waking other threads, which may be busy
/// with drawing, would cost more than they do.
constexpr Index worth_threads = 1000000;

/// Single precision serves down to this tolerance; what it cannot see is an energy of about the second
/// number; its values are good to about the third share.
constexpr double single_tolerance = 3e-5, single_floor = 1e-10, single_error = 1e-6;
/// Solves after which measurements that were only updated are taken afresh.
constexpr int most_uses = 16;

/// Share of the handles' part of the energy below which a rigid motion of everything must bring it.
constexpr double worthwhile_gain = 0.1;

}  // namespace

RadialSolver::State::State(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                           const LiveOptions& options, const Progress& progress,
                           std::shared_ptr<const RestShape> shape, std::shared_ptr<const HandleBlend> blend)
    : options_(options),
      samples_(options.symmetry == SymmetryPlane::none ? samples
                                                       : across(samples, axis_of(options.symmetry))),
      frame_(samples_.frame),
      surface_(samples_.points),
      surface_normals_(samples_.normals),
      blend_(std::move(blend)) {
  options.validate();
  require_samples(samples_);
  const Stopwatch watch;
  const ThreadScope threads(options.threads);
  const auto seed = static_cast<std::uint64_t>(options.seed);
  const int axis = axis_of(options.symmetry);
  if (!shape) shape = std::make_shared<const RestShape>(samples_, options.interior, seed, axis);
  Random random(seed);
  order_ = shape->order;
  chosen_ = stratified(order_, options.samples, random);
  std::vector<RadialScale> scales;
  if (options.coarse_centers > 0) scales.push_back({options.coarse_centers, options.coarse_radius_factor});
  scales.push_back({options.fine_centers, options.fine_radius_factor, true});
  if (axis >= 0) {
    mirror_.emplace();
    mirror_->axis = axis;
    basis_ = mirrored_basis({shape->sites, Points(0, 3), shape->layout}, scales, *mirror_);
  } else {
    basis_ = radial_basis(shape->sites, scales, shape->layout);
  }
  if (options.interior) basis_.set_embedding(shape->embedding);
  coefficients_ = basis_.identity();
  progress.report(0.2, "centers placed");
  surface_stiffness_ = SurfaceStiffness(shape->thickness, options.surface);
  own_bending_ = surface_stiffness_.bending(rows_of(surface_, chosen_));
  bound_ = BoundHandles(in_cube(handles, frame_), surface_);
  stiffen(progress.part(0.2, 0.8));
  prepare(fast_);
  set_handles(handles);
  report_.setup_seconds = watch.seconds();
}

template <class Scalar>
void RadialSolver::State::prepare(Precision<Scalar>& precision) {
  precision.objective =
      std::make_unique<RadialObjective<Scalar>>(basis_, rows_of(surface_, chosen_), options_.handle_weight);
  precision.objective->set_stiffness(bending_, weights_);
  precision.objective->set_mirror(mirror_);
  if (blend_) precision.objective->set_blend(RadialBlend<Scalar>(*blend_, rows_of(surface_, chosen_)));
  precision.objective->set_barrier(options_.surface.barrier, options_.surface.barrier_threshold);
  if (inverse_factor_.size() > 0) precision.objective->set_handles(pairs_, pair_values_, inverse_factor_);
  precision.objective->set_style(style_);
  precision.objective->set_hooks(hooks_, rows_of(surface_, chosen_));
  precision.objective->set_stance(stance_);
  weigh(precision);
}

void RadialSolver::State::set_hooks(const RadialHooks& hooks) {
  hooks_ = hooks;
  for_each_precision(
      [&](auto& precision) { precision.objective->set_hooks(hooks_, rows_of(surface_, chosen_)); });
  optimizer_.forget();
}

int RadialSolver::State::solve_threads() const {
  const Index work = static_cast<Index>(chosen_.size()) * basis_.center_count();
  return options_.threads == 0 && work < worth_threads ? 1 : options_.threads;
}

template <class Scalar>
QuasiNewtonReport RadialSolver::State::descend(Precision<Scalar>& precision,
                                               const QuasiNewtonOptions& options, const Progress& progress) {
  QuasiNewtonReport found;
  try {
    found = optimizer_.minimise(*precision.objective, options, coefficients_, precision.u, progress);
  } catch (...) {  // cancelled between two steps: the coefficients have gone on
    precision.u.resize(0);
    u_before_.resize(0);
    throw;
  }
  if (++precision.uses >= most_uses) precision.u.resize(0), precision.uses = 0;
  report_.iterations += found.iterations;
  report_.evaluations += found.evaluations;
  report_.converged = found.converged;
  report_.value = found.value;
  return found;
}

template QuasiNewtonReport RadialSolver::State::descend<float>(Precision<float>&, const QuasiNewtonOptions&,
                                                               const Progress&);

Index RadialSolver::State::follow(Index iterations, double tolerance, const Progress& progress) {
  const ThreadScope threads(solve_threads());
  const Stopwatch watch;
  if (iterations <= 0) iterations = options_.iterations;
  if (tolerance <= 0.0) tolerance = options_.tolerance;
  report_.iterations = report_.evaluations = 0;
  precondition(0.0);
  if (!handles_.empty() && !style_) follow_rigidly();
  extrapolate();
  const bool fast_alone = tolerance >= single_tolerance;
  const bool ended =
      descend(fast_, {iterations, std::max(tolerance, single_tolerance), single_floor}, progress).ended;
  if (!fast_alone) {
    if (!exact_.objective) prepare(exact_);
    exact_.u.resize(0);
    if (report_.iterations < iterations && !ended)
      descend(exact_, {iterations - report_.iterations, tolerance}, progress);
    fast_.u.resize(0);
  }
  if (handles_.empty() && hooks_.energies.empty()) hold_lowest();
  rest();
  report_.kinetic = report_.speed = 0.0;
  is_measured_ = false;
  is_exact_ = !fast_alone;
  report_.seconds = watch.seconds();
  return report_.iterations;
}

std::shared_ptr<RadialField> RadialSolver::State::solve(Index iterations, double tolerance,
                                                        const Progress& progress) {
  const Stopwatch watch;
  follow(iterations, tolerance, progress);
  report();
  report_.seconds = watch.seconds();
  return field();
}

const RadialReport& RadialSolver::State::report() {
  if (is_measured_) return report_;
  const ThreadScope threads(solve_threads());
  if (is_exact_)
    measure(exact_);
  else
    measure(fast_);
  is_measured_ = true;
  return report_;
}

/// Where handles moved together, the whole shape moves along first: no energy but theirs feels it.
void RadialSolver::State::follow_rigidly() {
  if (fast_.u.size() == 0) fast_.objective->measure(coefficients_, fast_.u);
  const Points values = fast_.objective->handle_values(fast_.u).cast<double>();
  const Alignment alignment = best_alignment(values, pairs_.targets, pairs_.weights);
  if (alignment.gain > worthwhile_gain) return;
  coefficients_ *= alignment.rotation.transpose();
  coefficients_.row(basis_.center_count()) += alignment.translation.transpose();
  if (mirror_) mirror_->symmetrise(coefficients_);
  fast_.u.resize(0);
  u_before_.resize(0);
  optimizer_.forget();
}

/// A drag goes on as it went: starts one step further along the last change where that is better.
void RadialSolver::State::extrapolate() {
  if (fast_.u.size() == 0) fast_.objective->measure(coefficients_, fast_.u);
  const VectorF start = fast_.u;
  const RowMatrix<double> from = coefficients_;
  if (u_before_.size() == start.size()) {
    const VectorF further = 2.0f * start - u_before_;
    const double here = fast_.objective->value(start, nullptr);
    if (fast_.objective->value(further, nullptr) < (1.0 - single_error) * here) {
      coefficients_ += from - coefficients_before_;
      fast_.u = further;
      exact_.u.resize(0);
    }
  }
  u_before_ = start;
  coefficients_before_ = from;
}

/// No energy of ours feels a translation: what is left of one is taken out exactly.
void RadialSolver::State::hold_lowest() {
  Points value(1, 3);
  RadialEvaluator<double>(basis_, pairs_.sources.topRows(1))
      .evaluate(coefficients_, {value.data(), 1, JetOrder::value});
  coefficients_.row(basis_.center_count()) += pairs_.sources.row(0) - value.row(0);
  if (mirror_) mirror_->symmetrise(coefficients_);
  fast_.u.resize(0);
  exact_.u.resize(0);
}

template <class Scalar>
void RadialSolver::State::measure(Precision<Scalar>& precision) {
  if (!precision.objective) prepare(precision);
  const RadialObjective<Scalar>& objective = *precision.objective;
  if (precision.u.size() == 0) objective.measure(coefficients_, precision.u);
  const RadialTerms terms = objective.terms(precision.u);
  report_.arap = terms.arap;
  report_.preference.reset();
  if (style_) report_.preference = preference_of(style_->style.preference, terms.gauss);
  report_.distortion =
      objective.with_jets(precision.u, [](JetView<const Scalar> jets) { return distortion<Scalar>(jets); });
  report_.notes = notes_on(report_.distortion, far_target(bound_, surface_));
  const Points values = objective.handle_values(precision.u).template cast<double>();
  // Those of the handles come first; without handles all count.
  const Index own = handles_.empty() ? values.rows() : static_cast<Index>(pair_rows_.size());
  const Vector distance = (values - pairs_.targets).topRows(own).rowwise().norm();
  report_.handle_mean =
      frame_.scale * distance.dot(pairs_.weights.head(own)) / pairs_.weights.head(own).sum();
  report_.handle_max = frame_.scale * distance.maxCoeff();
}

template void RadialSolver::State::measure<float>(Precision<float>&);

void RadialSolver::State::reset() {
  coefficients_ = basis_.identity();
  u_before_.resize(0);
  fast_.u.resize(0);
  exact_.u.resize(0);
  optimizer_.forget();
  std::vector<Handle> at_rest = handles_;
  for (Handle& handle : at_rest) {
    handle.target = handle.rest;
    handle.target_point = handle.rest_point;
  }
  set_targets(at_rest);
  rest();
  const double setup = report_.setup_seconds;
  report_ = {};
  report_.setup_seconds = setup;
  is_measured_ = true;
}

void RadialSolver::State::track(PointsIn points) {
  tracked_ = TrackedPoints(basis_, frame_, points);
  tracked_.set_influence(influence_.get());
  tracked_rest_ = points;
}

std::unique_ptr<RadialSolver::State> RadialSolver::State::with_symmetry(SymmetryPlane symmetry,
                                                                        const Progress& progress) const {
  LiveOptions options = options_;
  options.symmetry = symmetry;
  auto next = std::make_unique<State>(samples_, handles_, options, progress, nullptr, nullptr);
  if (style_asked_)
    next->set_style(style_asked_->style, style_asked_->strength, style_asked_->sharpness,
                    style_asked_->weights, style_asked_->up);
  next->set_hooks(hooks_);
  next->set_secondary_motion(body_.asked);
  if (next->inverse_factor_.size() == 0) next->factorise();
  next->adopt(*field());
  if (tracked_rest_.rows() > 0) next->track(tracked_rest_);
  next->report_.setup_seconds += report_.setup_seconds;
  return next;
}

std::shared_ptr<RadialField> RadialSolver::State::field() const {
  auto result = std::make_shared<RadialField>(basis_, coefficients_, influence_);
  result->set_frame(frame_);
  result->set_rest_points(rows_of(surface_, chosen_));
  return result;
}

}  // namespace arapfields
