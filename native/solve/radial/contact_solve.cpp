// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_solve.h"

#include <algorithm>
#include <utility>

#include "solve/radial/contact_handles.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Most iterations of escapes_local_minimum()'s solve without contact.
constexpr Index steps_apart = 60;
/// Most solves of separates_parts() after a leap: the first one often leaves parts a little in each other.
constexpr int most_solves_apart = 3;
/// Most steps with short pulls, where handles cannot reach their targets.
constexpr int most_pulls = 3;
/// Relative decrease of the energy with which its solution replaces the current one.
constexpr double better = 0.01;

/// Fills the report's part on contact.
void report_contact(RadialState& s, const std::vector<Index>& held_by) {
  const double depth = s.contact.deepest();
  ContactReport& report = s.report.contact = {};
  report.deepest = s.problem.frame().scale * depth;
  report.touching = s.contact.found().contact_area();
  report.unsettled = depth > ContactSet::deep;
  report.held = held_back_handles(s, held_by);
}

/// The objective without its contact term.
double value_without_contact(RadialState& s) {
  const RadialObjective<float>& objective = s.objective(s.fast);
  const VectorF& u = s.measurements(s.fast);
  return objective.value(u, nullptr) - objective.contact_value(u);
}

/// The state that a trial solve changes, to restore it if the trial is rejected.
struct Before {
  RadialShape shape;
  SolveHistory history;
  RadialReport report;
  ContactSnapshot snapshot;

  explicit Before(const RadialState& s)
      : shape(s.shape), history(s.history), report(s.report), snapshot(s.contact.snapshot()) {}
  void restore(RadialState& s) {
    s.shape.coefficients = shape.coefficients;
    s.shape.jumps = shape.jumps;
    ++s.shape.revision;
    s.history = std::move(history);
    s.report = std::move(report);
    s.contact.restore(std::move(snapshot), s.shape.coefficients);
  }
};

}  // namespace

ContactSolve::ContactSolve(RadialState& state, Index iterations, double tolerance, Freely freely,
                           const Progress& progress)
    : state_(state),
      iterations_(iterations),
      freely_(std::move(freely)),
      steps_(state, iterations, tolerance, progress),
      motions_(state.dynamics.motions) {
  const BoundHandles& handles = state.handles.bound();
  if (std::ssize(motions_) == handles.count()) return;
  motions_ = motions_of(handles);
  if (state.shape.coefficients == state.problem.basis.identity())
    motions_.assign(motions_.size(), Mat4::Identity());
}

void ContactSolve::follow() {
  RadialState& s = state_;
  const bool goes_on = s.contact.ended_at(s.shape.revision);
  steps_.sweep(motions_);
  const bool pressed = s.contact.has_planes() || s.report.contact.touching > 0.0;
  s.contact.find(s.shape.coefficients);
  if (!goes_on && s.contact.deepest_outside() > ContactApproach::too_deep) start_at_rest();
  if (escapes_local_minimum()) return;
  const bool slowly = s.in_one_go && !s.contact.crossing_surfaces().empty();
  const bool leaps = s.contact.only_itself() && longest_motion() > steps_.length(ContactApproach::usual);
  if (leaps || (!pressed && may_be_without_contact())) {
    const RowMatrix<double> start = s.shape.coefficients;
    if (ends_without_contact()) return;
    const bool parts_overlap = s.contact.deepest_outside() <= 0.0;
    if (parts_overlap && separates_parts(leaps ? most_solves_apart : 1)) return;
    go_back(start);
  }
  approach(slowly);
}

/// Restarts from the rest shape, where the current one has no history of contact.
void ContactSolve::start_at_rest() {
  go_back(state_.problem.basis.identity());
  motions_.assign(motions_.size(), Mat4::Identity());
}

/// The longest distance of a handle's target from its position under the last motions, in cube units.
double ContactSolve::longest_motion() const {
  const HandleTerms& handles = state_.handles;
  const Points from = handles.targets_at(motions_between(handles.bound(), motions_, 0.0));
  return (handles.pairs().targets - from).rowwise().norm().maxCoeff();
}

void ContactSolve::go_back(const RowMatrix<double>& coefficients) {
  state_.shape.coefficients = coefficients;
  state_.shape.jump();
  state_.contact.begin(coefficients);
}

/// Starts at these coefficients if they have less energy without contact.
bool ContactSolve::starts_better(const RowMatrix<double>& coefficients) {
  RadialState& s = state_;
  const double value = value_without_contact(s);
  const RowMatrix<double> before = std::exchange(s.shape.coefficients, coefficients);
  s.shape.jump();
  if (value_without_contact(s) < value) return true;
  s.shape.coefficients = before;
  ++s.shape.revision;
  return false;
}

/// If self-contact holds a handle back, the shape may be in a poor local minimum: tries a solve without
/// contact, and if the handles do not move, a projection of what overlaps after it. Returns whether the
/// result is accepted; if not, the state is restored.
bool ContactSolve::escapes_local_minimum() {
  RadialState& s = state_;
  const std::vector<HeldBack>& held = s.report.contact.held;
  const Points& targets = s.handles.pairs().targets;
  if (std::none_of(held.begin(), held.end(), [](const HeldBack& h) { return h.by == "itself"; })) {
    s.tried = {};
    return false;
  }
  const bool rests = longest_motion() == 0.0;
  const bool again = s.tried.targets.rows() == targets.rows();
  const double tried_within = rests ? 0.0 : ContactApproach::usual.length;
  if (again && (targets - s.tried.targets).rowwise().norm().maxCoeff() <= tried_within) return false;
  const double value = value_without_contact(s);
  Before before(s);
  s.contact.release();
  const bool goes_on = again && starts_better(s.tried.coefficients);
  freely_(goes_on ? std::min(2 * iterations_, steps_apart) : steps_apart);
  s.tried = {targets, s.shape.coefficients};
  s.report.contact = {};
  if (s.contact.find(s.shape.coefficients, 0.0, true) <= 0.0) {
    s.contact.release();
    if (!s.contact.overlaps(s.shape.coefficients)) return true;
  } else if (rests && s.contact.deepest_outside() <= 0.0) {
    steps_.approach_at_once(motions_);
    report_contact(s, steps_.held_by());
    if (!s.contact.overlaps(s.shape.coefficients) && value_without_contact(s) < (1.0 - better) * value)
      return true;
  }
  before.restore(s);
  return false;
}

bool ContactSolve::may_be_without_contact() const {
  return state_.contact.deepest() <= 0.0 && !state_.contact.touches_itself();
}

/// Solves without contact. Returns whether nothing penetrates after it.
bool ContactSolve::ends_without_contact() {
  RadialState& s = state_;
  s.contact.release();
  freely_(iterations_);
  s.report.contact = {};
  if (s.contact.find(s.shape.coefficients, 0.0, true) > 0.0) {
    s.report.iterations = s.report.evaluations = 0;
    return false;
  }
  s.contact.release();
  return true;
}

/// Separates parts that overlap after a solve without contact, by so many solves in contact at most, while
/// the constraints that were found are violated. Returns whether that succeeds.
bool ContactSolve::separates_parts(int most_solves) {
  bool apart = false;
  for (int solve = 0; solve < most_solves && !apart; ++solve) {
    if (solve > 0 && state_.contact.deepest() <= ContactSet::deep) return false;
    steps_.approach_at_once(motions_);
    apart = !state_.contact.overlaps(state_.shape.coefficients);
  }
  if (apart) report_contact(state_, steps_.held_by());
  return apart;
}

/// Whether points are left inside an obstacle, or parts in each other.
bool ContactSolve::is_inside() const {
  return state_.contact.deepest_outside() > ContactApproach::nearly ||
         state_.contact.overlaps(state_.shape.coefficients);
}

/// Continuation in usual steps; `slowly`, or where that leaves points inside: in small steps as well, and the
/// better of both results is kept.
void ContactSolve::approach(bool slowly) {
  const RowMatrix<double> start = state_.shape.coefficients;
  steps_.approach(motions_, longest_motion(), ContactApproach::usual);
  slowly = slowly || (state_.in_one_go && is_inside());
  if (slowly && longest_motion() > steps_.length(ContactApproach::small)) approach_again_slowly(start);
  if (slowly && state_.contact.overlaps(state_.shape.coefficients)) approach_while_apart(start);
  report_contact(state_, steps_.held_by());
}

/// Continuation in small steps that ends where the next one would put a part into another or press it flat,
/// and from there as far as short pulls lead.
void ContactSolve::approach_while_apart(const RowMatrix<double>& start) {
  if (state_.contact.overlaps(start)) return;
  const BoundHandles& handles = state_.handles.bound();
  go_back(start);
  state_.contact.find(start);
  const Index steps = steps_.count(longest_motion(), ContactApproach::small);
  for (Index k = 1; k <= steps; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(steps);
    if (!stays_apart(motions_between(handles, motions_, share), Pull::short_where_held)) break;
  }
  for (int pull = 0; pull < most_pulls; ++pull)
    if (!stays_apart(motions_of(handles), Pull::short_for_all)) break;
}

/// Takes a step, and takes it back if parts overlap after it.
bool ContactSolve::stays_apart(const std::vector<Mat4>& motions, Pull pull) {
  Before before(state_);
  steps_.step(motions, ContactApproach::small.iterations, pull);
  if (!state_.contact.overlaps(state_.shape.coefficients)) return true;
  before.restore(state_);
  return false;
}

void ContactSolve::approach_again_slowly(const RowMatrix<double>& start) {
  RadialState& s = state_;
  const auto badness = [&] { return std::pair(is_inside(), value_without_contact(s)); };
  const std::pair<bool, double> bad = badness();
  const RowMatrix<double> there = s.shape.coefficients;
  ContactSnapshot snapshot = s.contact.snapshot();
  go_back(start);
  steps_.approach(motions_, longest_motion(), ContactApproach::small);
  if (!(bad < badness())) return;
  s.shape.coefficients = there;
  s.shape.jump();
  s.contact.restore(std::move(snapshot), s.shape.coefficients);
}

}  // namespace arapfields
