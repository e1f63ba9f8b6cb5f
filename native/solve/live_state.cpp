// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_state.h"

#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "solve/live_setup.h"
#include "solve/live_stiffness.h"
#include "solve/notes.h"
#include "solve/rest_shape.h"
#include "solve/setup.h"
#include "solve/surface_stiffness.h"

namespace arapfields {
namespace {

/// Weight, against the surface's energy, with which a style without handles holds the lowest sample in place.
constexpr double anchor_weight = 1.0;

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

LiveSolver::State::State(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                         const LiveOptions& options, const Progress& progress,
                         std::shared_ptr<const RestShape> shape, std::shared_ptr<const HandleBlend> blend)
    : options_(options),
      frame_(samples.frame),
      surface_(samples.points),
      surface_normals_(samples.normals),
      blend_(std::move(blend)) {
  options.validate();
  const Stopwatch watch;
  const ThreadScope threads(options.threads);
  const auto seed = static_cast<std::uint64_t>(options.seed);
  if (!shape) shape = std::make_shared<const RestShape>(samples, options.interior, seed);
  Random random(seed);
  chosen_ = stratified(shape->order, options.samples, random);
  std::vector<RadialScale> scales;
  if (options.coarse_centers > 0) scales.push_back({options.coarse_centers, options.coarse_radius_factor});
  scales.push_back({options.fine_centers, options.fine_radius_factor, true});
  basis_ = radial_basis(shape->sites, scales, shape->layout);
  if (options.interior) basis_.set_embedding(shape->embedding);
  coefficients_ = basis_.identity();
  progress.report(0.2, "centers placed");
  bending_ = SurfaceStiffness(shape->thickness, options.surface).bending(rows_of(surface_, chosen_));
  stiffness_ =
      stiffness_matrix(basis_, rows_of(surface_, chosen_), bending_, progress.part(0.2, 0.8), blend_.get());
  prepare(fast_);
  set_handles(handles);
  report_.setup_seconds = watch.seconds();
}

template <class Scalar>
void LiveSolver::State::prepare(Precision<Scalar>& precision) {
  precision.objective = std::make_unique<LiveObjective<Scalar>>(basis_, rows_of(surface_, chosen_), bending_,
                                                                options_.handle_weight);
  if (blend_) precision.objective->set_blend(LiveBlend<Scalar>(*blend_, rows_of(surface_, chosen_)));
  precision.objective->set_barrier(options_.surface.barrier, options_.surface.barrier_threshold);
  if (inverse_factor_.size() > 0) precision.objective->set_handles(pairs_, pair_values_, inverse_factor_);
  precision.objective->set_style(style_);
  precision.objective->set_hooks(hooks_, rows_of(surface_, chosen_));
  precision.objective->set_stance(stance_);
}

void LiveSolver::State::choose_pairs() {
  pair_rows_.clear();
  if (handles_.empty()) {
    Index lowest = 0;
    (surface_ * up_).minCoeff(&lowest);
    pairs_ = {surface_.row(lowest), surface_.row(lowest),
              Vector::Constant(1, anchor_weight / options_.handle_weight)};
    return;
  }
  Random random(static_cast<std::uint64_t>(options_.seed), 1);
  std::vector<double> weights;
  for (Index i = 0; i < bound_.count(); ++i) {
    const std::vector<Index> rows =
        random_subset(bound_.begin(i + 1) - bound_.begin(i), options_.handle_samples, random);
    const double share = 1.0 / static_cast<double>(static_cast<Index>(rows.size()) * bound_.count());
    for (const Index row : rows) {
      pair_rows_.push_back(bound_.begin(i) + row);
      weights.push_back(bound_.handle(i).weight * share);
    }
  }
  pairs_ = {rows_of(bound_.sources(), pair_rows_), rows_of(bound_.targets(), pair_rows_),
            Eigen::Map<const Vector>(weights.data(), static_cast<Index>(weights.size()))};
}

void LiveSolver::State::set_handles(const std::vector<Handle>& handles) {
  const ThreadScope threads(options_.threads);
  bound_ = BoundHandles(in_cube(handles, frame_), surface_);
  handles_ = handles;
  choose_pairs();
  choose_stance();
  inverse_factor_.resize(0, 0);
  if (!handles_.empty()) factorise();
}

/// The preconditioner of the handles and the stance at hand.
void LiveSolver::State::factorise() {
  pair_values_ = radial_rows(basis_, pairs_.sources, JetOrder::value);
  RowMatrix<double> values = pair_values_;
  Vector weights = options_.handle_weight * pairs_.weights;
  if (stance_) {
    const auto [rows, shares] = stance_rows(basis_, stance_->rest, stance_->stance);
    values.conservativeResize(values.rows() + rows.rows(), Eigen::NoChange);
    weights.conservativeResize(values.rows());
    values.bottomRows(rows.rows()) = rows;
    weights.tail(rows.rows()) = stance_->weight * shares;
  }
  inverse_factor_ = inverse_factor(stiffness_, values, weights);
  for_each_precision([&](auto& precision) {
    precision.objective->set_handles(pairs_, pair_values_, inverse_factor_);
    precision.objective->set_stance(stance_);
    precision.u.resize(0);
  });
  u_before_.resize(0);
  optimizer_.forget();
}

void LiveSolver::State::set_targets(const std::vector<Handle>& moved) {
  bound_.retarget(in_cube(moved, frame_));
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    handles_[i].target = moved[i].target;
    handles_[i].target_point = moved[i].target_point;
  }
  if (handles_.empty()) return;
  pairs_.targets = rows_of(bound_.targets(), pair_rows_);
  for_each_precision([&](auto& precision) { precision.objective->set_targets(pairs_.targets); });
}

void LiveSolver::State::set_hooks(const LiveHooks& hooks) {
  hooks_ = hooks;
  for_each_precision(
      [&](auto& precision) { precision.objective->set_hooks(hooks_, rows_of(surface_, chosen_)); });
  optimizer_.forget();
}

int LiveSolver::State::solve_threads() const {
  const Index work = static_cast<Index>(chosen_.size()) * basis_.center_count();
  return options_.threads == 0 && work < worth_threads ? 1 : options_.threads;
}

template <class Scalar>
QuasiNewtonReport LiveSolver::State::descend(Precision<Scalar>& precision, const QuasiNewtonOptions& options,
                                             const Progress& progress) {
  const QuasiNewtonReport found =
      optimizer_.minimise(*precision.objective, options, coefficients_, precision.u, progress);
  if (++precision.uses >= most_uses) precision.u.resize(0), precision.uses = 0;
  report_.iterations += found.iterations;
  report_.evaluations += found.evaluations;
  report_.converged = found.converged;
  report_.value = found.value;
  return found;
}

std::shared_ptr<RadialField> LiveSolver::State::solve(Index iterations, double tolerance,
                                                      const Progress& progress) {
  const ThreadScope threads(solve_threads());
  const Stopwatch watch;
  if (iterations <= 0) iterations = options_.iterations;
  if (tolerance <= 0.0) tolerance = options_.tolerance;
  report_.iterations = report_.evaluations = 0;
  if (inverse_factor_.size() == 0) factorise();
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
  if (fast_alone)
    measure(fast_);
  else
    measure(exact_);
  report_.seconds = watch.seconds();
  return field();
}

/// Where handles moved together, the whole shape moves along first: no energy but theirs feels it.
void LiveSolver::State::follow_rigidly() {
  if (fast_.u.size() == 0) fast_.objective->measure(coefficients_, fast_.u);
  const Points values = fast_.objective->handle_values(fast_.u).cast<double>();
  const Alignment alignment = best_alignment(values, pairs_.targets, pairs_.weights);
  if (alignment.gain > worthwhile_gain) return;
  coefficients_ *= alignment.rotation.transpose();
  coefficients_.row(basis_.center_count()) += alignment.translation.transpose();
  fast_.u.resize(0);
  u_before_.resize(0);
  optimizer_.forget();
}

/// A drag goes on as it went: starts one step further along the last change where that is better.
void LiveSolver::State::extrapolate() {
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
void LiveSolver::State::hold_lowest() {
  Points value(1, 3);
  RadialEvaluator<double>(basis_, pairs_.sources).evaluate(coefficients_, {value.data(), 1, JetOrder::value});
  coefficients_.row(basis_.center_count()) += pairs_.sources.row(0) - value.row(0);
  fast_.u.resize(0);
  exact_.u.resize(0);
}

template <class Scalar>
void LiveSolver::State::measure(Precision<Scalar>& precision) {
  const LiveObjective<Scalar>& objective = *precision.objective;
  if (precision.u.size() == 0) objective.measure(coefficients_, precision.u);
  const LiveTerms terms = objective.terms(precision.u);
  report_.arap = terms.arap;
  report_.preference.reset();
  if (style_) report_.preference = 1.0 - terms.gauss;
  report_.distortion =
      objective.with_jets(precision.u, [](JetView<const Scalar> jets) { return distortion<Scalar>(jets); });
  report_.notes = notes_on(report_.distortion, far_target(bound_, surface_));
  const Points values = objective.handle_values(precision.u).template cast<double>();
  const Vector distance = (values - pairs_.targets).rowwise().norm();
  report_.handle_mean = frame_.scale * distance.dot(pairs_.weights) / pairs_.weights.sum();
  report_.handle_max = frame_.scale * distance.maxCoeff();
}

void LiveSolver::State::reset() {
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
  const double setup = report_.setup_seconds;
  report_ = {};
  report_.setup_seconds = setup;
}

/// The projection in the surrogate's norm, by conjugate gradients, since the preconditioner knows a part of
/// the samples. What single precision leaves of far coefficients grows with each round: the round of least
/// energy is the start.
void LiveSolver::State::adopt(const DeformationField& field) {
  constexpr int rounds = 8;
  const ThreadScope threads(options_.threads);
  const LiveObjective<float>& objective = *fast_.objective;
  const Points places = rows_of(surface_, chosen_);
  JetBlock<double> jets(places.rows(), JetOrder::second);
  field.evaluate(places, jets.view());
  Points ends(pairs_.sources.rows(), 3);
  field.evaluate(pairs_.sources, {ends.data(), ends.rows(), JetOrder::value});
  VectorF wanted = VectorF::Zero(30 * places.rows() + 3 * ends.rows() + 3 * basis_.center_count());
  if (blend_) LiveBlend<double>(*blend_, places).multiply(jets.view());
  wanted.head(30 * places.rows()) =
      Eigen::Map<const Vector>(jets.view().data, 30 * places.rows()).cast<float>();
  wanted.segment(30 * places.rows(), 3 * ends.rows()) =
      Eigen::Map<const Vector>(ends.data(), 3 * ends.rows()).cast<float>();
  const auto dot = [](const auto& a, const auto& b) { return a.cwiseProduct(b).sum(); };
  VectorF u, du;
  objective.measure(coefficients_, u);
  double value = objective.value(u, nullptr);
  RowMatrix<double> residual = objective.pull_back(objective.weighted(wanted - u));
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
    coefficients_ += step * direction;
    residual -= step * product;
    image = objective.precondition(residual);
    const double next = dot(residual, image);
    direction = image + next / square * direction;
    square = next;
  }
  fast_.u.resize(0);
  exact_.u.resize(0);
  u_before_.resize(0);
  optimizer_.forget();
}

std::shared_ptr<RadialField> LiveSolver::State::field() const {
  auto result = std::make_shared<RadialField>(basis_, coefficients_);
  result->set_frame(frame_);
  result->set_rest_points(rows_of(surface_, chosen_));
  return result;
}

}  // namespace arapfields
