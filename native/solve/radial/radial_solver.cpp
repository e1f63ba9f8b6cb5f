// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/radial_solver.h"

#include <algorithm>

#include "core/parallel.h"
#include "energies/alignment.h"
#include "energies/shared_motion.h"
#include "energies/stance.h"
#include "sampling/sample_weights.h"
#include "solve/contact/continuation.h"
#include "solve/radial/handle_motion.h"
#include "solve/radial/part_way.h"
#include "solve/radial/state.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Smallest tolerance of solves in single precision, and the absolute energy that it resolves.
constexpr double single_tolerance = 3e-5, single_floor = 1e-10;

/// A rigid motion is applied if it reduces the handles' energy to at most this fraction.
constexpr double worthwhile_gain = 0.1;

/// Moves the whole shape by the best rigid alignment with the targets: only the handles' energy depends on
/// it, and locality, which asks for the motion of those handles that share one.
void follow_rigidly(RadialState& s) {
  const HandleBatch<double>& pairs = s.handles.pairs();
  const VectorF& u = s.measurements(s.fast);
  const Points values = s.fast.objective.latest()->handle_values(u).cast<double>();
  Vector weights = pairs.weights;
  if (const Locality locality = s.locality(); locality.acts()) {
    const Points shared = affine_image(pairs.sources, locality.motion);
    for (Index i = 0; i < weights.size(); ++i)
      if ((shared - pairs.targets).row(i).norm() > shared_within) weights[i] = 0.0;
    if (!(weights.sum() > 0.0)) return;
  }
  const Alignment alignment = best_alignment(values, pairs.targets, weights);
  if (alignment.gain > worthwhile_gain) return;
  s.shape.coefficients *= alignment.rotation.transpose();
  s.shape.coefficients.row(s.problem.basis.center_count()) += alignment.translation.transpose();
  if (s.problem.mirror) s.problem.mirror->symmetrise(s.shape.coefficients);
  s.shape.jump();
}

/// A solve without contact.
void follow_freely(RadialState& s, Index iterations, double tolerance, const Progress& progress) {
  s.precondition(0.0);
  s.objective(s.fast);
  if (s.handles.any() && !s.style.any()) follow_rigidly(s);
  SolveHistory::Start start = s.extrapolate();
  const QuasiNewtonOptions single{iterations, std::max(tolerance, single_tolerance), single_floor};
  const bool ended = s.descend(s.fast, single, progress).ended;
  const bool is_exact = tolerance < single_tolerance;
  if (is_exact) {
    ++s.shape.revision;  // measurements are recomputed in double precision, and in the next solve's single
    s.objective(s.exact);
    if (s.report.iterations < iterations && !ended)
      s.descend(s.exact, {iterations - s.report.iterations, tolerance}, progress);
  }
  // Recomputed measurements differ from updated ones by rounding errors, which extrapolation would amplify.
  if (is_exact || s.fast.uses == 0) start.u.resize(0);
  s.history.start.set(s.start_revisions(), std::move(start));
}

/// Translates the field so that the surface's middle stays where it is, seen from above, and the lowest
/// sample keeps its height; no other term depends on translations. The sample is then held there.
void anchor(RadialState& s) {
  const Points places = anchor_places(s.handles.pairs().sources.row(0).transpose(), s.problem.energy_points);
  Points values(places.rows(), 3);
  RadialEvaluator<double>(s.problem.basis, places)
      .evaluate(s.shape.coefficients, {values.data(), places.rows(), JetOrder::value});
  const Vec3 shift = anchoring_shift(places, values, s.handles.up());
  s.shape.coefficients.row(s.problem.basis.center_count()) += shift.transpose();
  if (s.problem.mirror) s.problem.mirror->symmetrise(s.shape.coefficients);
  ++s.shape.revision;
  s.handles.move_anchor(values.row(0).transpose() + shift);
}

std::shared_ptr<RadialField> field_of(const RadialState& s, RowMatrix<double> coefficients) {
  auto result =
      std::make_shared<RadialField>(s.problem.basis, std::move(coefficients), s.handles.influence());
  result->set_frame(s.problem.frame());
  result->set_rest_points(s.problem.energy_points);
  return result;
}

/// Fills the report's figures of triangles that pass through each other.
void count_crossings(RadialState& s) {
  s.report.contact.self_intersections.reset();
  if (!s.contact.sees_crossings()) return;
  const std::vector<SelfCrossing> crossings =
      s.contact.self_crossings(s.shape.coefficients, s.handles.influence());
  s.report.contact.self_intersections = std::ssize(crossings);
  if (!crossings.empty())
    s.report.contact.intersection =
        s.problem.frame().to_mesh(crossings.front().place.transpose()).row(0).transpose();
}

}  // namespace

RadialSolver::RadialSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                           const LiveOptions& options, const Progress& progress,
                           std::shared_ptr<const RestShape> shape, std::shared_ptr<const HandleBlend> blend) {
  options.validate();
  const Stopwatch watch;
  const ThreadScope threads(options.threads);
  state_ = std::make_unique<RadialState>(samples, options, progress, std::move(shape), std::move(blend));
  state_->handles.set(handles);
  state_->stiffness.update(state_->handles.bound(), progress.part(0.2, 0.8));
  state_->objective(state_->fast);
  if (!handles.empty()) state_->precondition(0.0);
  state_->report.setup_seconds = watch.seconds();
}

RadialSolver::~RadialSolver() = default;
RadialSolver::RadialSolver(RadialSolver&&) noexcept = default;
RadialSolver& RadialSolver::operator=(RadialSolver&&) noexcept = default;

void RadialSolver::set_handles(const std::vector<Handle>& handles) {
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.options.threads);
  if (s.style.any()) require_no_reach(handles);
  s.handles.set(handles);
  s.dynamics.motions.clear();
  s.stiffness.update(s.handles.bound());
  if (!handles.empty()) s.precondition(s.preconditioner.inertia);
}

void RadialSolver::set_style(const Style& style, double strength, double sharpness, const Vector& weights,
                             const Vec3& up) {
  RadialState& s = *state_;
  if (strength != 0.0) require_no_reach(s.handles.handles());
  s.style.set({style, strength, sharpness, weights, up});
  if (s.style.any()) s.handles.set_up(up);
}

void RadialSolver::clear_style() { state_->style.clear(); }

void RadialSolver::set_hooks(const RadialHooks& hooks) {
  state_->hooks = hooks;
  ++state_->hooks_revision;
}

void RadialSolver::set_weights(const Vector& weights, const Vector& bend_weights) {
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.options.threads);
  s.problem.samples = with_weights(s.problem.samples, s.problem.at_all("weights", weights),
                                   s.problem.at_all("bend_weights", bend_weights));
  s.stiffness.update(s.handles.bound());
  if (s.handles.any()) s.precondition(s.preconditioner.inertia);
}

void RadialSolver::set_symmetry(SymmetryPlane symmetry, const Progress& progress) {
  RadialState& s = *state_;
  LiveOptions options = s.problem.options;
  if (symmetry == options.symmetry) return;
  options.symmetry = symmetry;
  RadialSolver next(s.problem.given_samples(), s.handles.handles(), options, progress);
  if (const auto& request = s.style.request())
    next.set_style(request->style, request->strength, request->sharpness, request->weights, request->up);
  next.set_hooks(s.hooks);
  next.set_secondary_motion(s.dynamics.motion(), progress);
  next.set_contact(s.contact.contact(), s.in_one_go, progress);
  next.adopt(*field_of(s, s.shape.coefficients));
  if (s.tracked.size() > 0) next.track(s.tracked.rest(), s.tracked.triangles());
  next.state_->report.setup_seconds += s.report.setup_seconds;
  *this = std::move(next);
}

void RadialSolver::set_contact(const std::optional<Contact>& contact, bool in_one_go,
                               const Progress& progress) {
  const ThreadScope threads(state_->problem.options.threads);
  if (contact && contact->any()) state_->contact.prepare(progress);
  state_->in_one_go = in_one_go;
  state_->contact.set(contact, state_->shape.coefficients);
  if (!state_->contact.has_planes()) state_->report.contact = {};  // of other obstacles
}

void RadialSolver::set_targets(const std::vector<Handle>& moved) { state_->handles.set_targets(moved); }

Index RadialSolver::follow(Index iterations, double tolerance, const Progress& progress) {
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.solve_threads());
  const Stopwatch watch;
  if (iterations <= 0) iterations = s.problem.options.iterations;
  if (tolerance <= 0.0) tolerance = s.problem.options.tolerance;
  s.report.iterations = s.report.evaluations = 0;
  const bool is_exact = tolerance < single_tolerance;
  const auto freely = [&](Index steps) { follow_freely(s, steps, tolerance, progress); };
  if (s.contact.any())
    solve_in_contact(s, iterations, std::max(tolerance, single_tolerance), freely, progress);
  else
    freely(iterations);
  if (!s.handles.any() && !s.hooks.adds_terms() && !s.contact.has_planes()) anchor(s);
  s.contact.end_at(s.shape.revision);
  s.report.contact.crossing.clear();
  for (const Index k : s.contact.crossing_surfaces())
    s.report.contact.crossing.push_back(s.contact.name_of(k));
  s.dynamics.zero_velocity(motions_of(s.handles.bound()));
  s.report.kinetic = s.report.speed = 0.0;
  s.unmeasured = is_exact ? RadialState::Unmeasured::exact : RadialState::Unmeasured::fast;
  s.report.seconds = watch.seconds();
  return s.report.iterations;
}

std::shared_ptr<RadialField> RadialSolver::solve(Index iterations, double tolerance,
                                                 const Progress& progress) {
  const Stopwatch watch;
  follow(iterations, tolerance, progress);
  report();
  state_->report.seconds = watch.seconds();
  return field();
}

const RadialReport& RadialSolver::report() const {
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.solve_threads());
  if (s.unmeasured != RadialState::Unmeasured::nothing) count_crossings(s);
  if (s.unmeasured == RadialState::Unmeasured::exact) s.measure(s.exact);
  if (s.unmeasured == RadialState::Unmeasured::fast) s.measure(s.fast);
  return s.report;
}

void RadialSolver::reset() {
  RadialState& s = *state_;
  s.shape.coefficients = s.problem.basis.identity();
  s.invalidate_history();
  s.contact.begin(s.shape.coefficients);
  std::vector<Handle> at_rest = handles();
  for (Handle& handle : at_rest) {
    handle.target = handle.rest;
    handle.target_point = handle.rest_point;
  }
  set_targets(at_rest);
  s.handles.rest_anchor();
  s.dynamics.zero_velocity(motions_of(s.handles.bound()));
  const double setup = s.report.setup_seconds;
  s.report = {};
  s.report.setup_seconds = setup;
  s.unmeasured = RadialState::Unmeasured::nothing;
}

void RadialSolver::track(PointsIn points, std::shared_ptr<const Triangles> triangles) {
  state_->tracked =
      TrackedPoints(state_->problem.basis, state_->problem.frame(), points, std::move(triangles));
}

PointsF RadialSolver::tracked() const {
  state_->tracked.set_influence(state_->handles.influence());
  return state_->tracked.moved(shown_coefficients(*state_));
}

std::shared_ptr<RadialField> RadialSolver::field() const {
  return field_of(*state_, shown_coefficients(*state_));
}

const std::vector<Handle>& RadialSolver::handles() const { return state_->handles.handles(); }

}  // namespace arapfields
