// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/continuation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "solve/contact/forces.h"
#include "solve/contact/handles.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

using P = ContactParameters;

using Pace = ContactParameters::Pace;

PointsF sample_places(RadialState& s) { return s.objective(s.fast).sample_values(s.measurements(s.fast)); }

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

/// A solve with contact constraints, from the shape and the targets of the last one. It tries in turn: one
/// without contact, accepted if nothing penetrates after it; a projection that separates the parts which
/// overlap after that; and continuation: handles move to their targets, and obstacles to their placements, in
/// steps so small that no sample tunnels through a surface, with a few quasi-Newton iterations after each.
class ContactSolve {
 public:
  ContactSolve(RadialState& state, Index iterations, double tolerance, const SolveFreely& freely,
               const Progress& progress);
  void follow();

 private:
  // The solve as a whole, and its trials
  void start_at_rest();
  double longest_motion() const;
  bool escapes_local_minimum();
  bool starts_better(const RowMatrix<double>& coefficients);
  bool may_be_without_contact() const;
  bool ends_without_contact();
  bool separates_parts(int most_solves);
  bool is_inside() const;
  void approach(bool slowly);
  void approach_again_slowly(const RowMatrix<double>& start);
  void approach_while_apart(const RowMatrix<double>& start);
  bool stays_apart(const std::vector<Mat4>& motions, Pull pull);
  void go_back(const RowMatrix<double>& coefficients);
  void report_contact();
  // Its steps
  void sweep();
  void approach_in_steps(const Pace& pace);
  void approach_by(Index steps, Index on_the_way);
  void step(const std::vector<Mat4>& motions, Index iterations, Pull pull = Pull::short_where_held);
  void solve_to_targets(const std::vector<Mat4>& motions, bool to_its_end, SolveHistory::Start* start);
  bool solve_round(const RowMatrix<double>& before, Index iterations);
  void find_and_push(int pushes, double from);
  bool goes_to_its_end() const;
  double length(const Pace& pace) const { return state_.contact.itself() ? pace.length_itself : pace.length; }
  Index count(double distance, const Pace& pace) const {
    return std::min(static_cast<Index>(std::ceil(distance / length(pace))), pace.most_steps);
  }

  RadialState& state_;
  Index iterations_;
  double tolerance_;
  const SolveFreely& freely_;
  const Progress& progress_;
  std::vector<Mat4> motions_;   // of the handles, for which the current shape was solved
  std::vector<Index> held_by_;  // the surfaces that held the handles back in the last solve
  bool swept_ = false;          // the last sweep took more than one step
};

ContactSolve::ContactSolve(RadialState& state, Index iterations, double tolerance, const SolveFreely& freely,
                           const Progress& progress)
    : state_(state),
      iterations_(iterations),
      tolerance_(tolerance),
      freely_(freely),
      progress_(progress),
      motions_(state.dynamics.motions) {
  const BoundHandles& handles = state.handles.bound();
  if (std::ssize(motions_) == handles.count()) return;
  motions_ = motions_of(handles);
  if (state.shape.coefficients == state.problem.basis.identity())
    motions_.assign(motions_.size(), Mat4::Identity());
}

/// Fills the report's part on contact.
void ContactSolve::report_contact() {
  const ContactConstraints& contact = state_.contact;
  ContactReport& report = state_.report.contact = {};
  report.deepest = state_.problem.frame().scale * contact.deepest();
  report.touching = contact.found().contact_area();
  report.unsettled = contact.deepest() > P::depth_tolerance;
  report.held = held_back_handles(state_, held_by_);
}

void ContactSolve::follow() {
  RadialState& s = state_;
  const bool goes_on = s.contact.ended_at(s.shape.revision);
  sweep();
  const bool pressed = s.contact.has_planes() || s.report.contact.touching > 0.0;
  s.contact.find(s.shape.coefficients);
  if (!goes_on && s.contact.deepest_outside() > P::too_deep) start_at_rest();
  if (escapes_local_minimum()) return;
  const bool slowly = s.in_one_go && !s.contact.crossing_surfaces().empty();
  const bool leaps = s.contact.only_itself() && longest_motion() > length(P::usual);
  if (leaps || (!pressed && may_be_without_contact())) {
    const RowMatrix<double> start = s.shape.coefficients;
    if (ends_without_contact()) return;
    const bool parts_overlap = s.contact.deepest_outside() <= 0.0;
    if (parts_overlap && separates_parts(leaps ? P::most_separations : 1)) return;
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
  const double tried_within = rests ? 0.0 : P::usual.length;
  if (again && (targets - s.tried.targets).rowwise().norm().maxCoeff() <= tried_within) return false;
  const double value = value_without_contact(s);
  Before before(s);
  s.contact.release();
  const bool goes_on = again && starts_better(s.tried.coefficients);
  freely_(goes_on ? std::min(2 * iterations_, P::trial_iterations) : P::trial_iterations);
  s.tried = {targets, s.shape.coefficients};
  s.report.contact = {};
  if (s.contact.find(s.shape.coefficients, 0.0, true) <= 0.0) {
    s.contact.release();
    if (!s.contact.overlaps(s.shape.coefficients)) return true;
  } else if (rests && s.contact.deepest_outside() <= 0.0) {
    approach_by(1, 0);
    report_contact();
    if (!s.contact.overlaps(s.shape.coefficients) && value_without_contact(s) < (1.0 - P::better) * value)
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
    if (solve > 0 && state_.contact.deepest() <= P::depth_tolerance) return false;
    approach_by(1, 0);
    apart = !state_.contact.overlaps(state_.shape.coefficients);
  }
  if (apart) report_contact();
  return apart;
}

/// Whether points are left inside an obstacle, or parts in each other.
bool ContactSolve::is_inside() const {
  return state_.contact.deepest_outside() > P::projected_depth ||
         state_.contact.overlaps(state_.shape.coefficients);
}

/// Continuation in usual steps; `slowly`, or where that leaves points inside: in small steps as well, and the
/// better of both results is kept.
void ContactSolve::approach(bool slowly) {
  const RowMatrix<double> start = state_.shape.coefficients;
  approach_in_steps(P::usual);
  slowly = slowly || (state_.in_one_go && is_inside());
  if (slowly && longest_motion() > length(P::small)) approach_again_slowly(start);
  if (slowly && state_.contact.overlaps(state_.shape.coefficients)) approach_while_apart(start);
  report_contact();
}

/// Continuation in small steps that ends where the next one would put a part into another or press it flat,
/// and from there as far as short pulls lead.
void ContactSolve::approach_while_apart(const RowMatrix<double>& start) {
  if (state_.contact.overlaps(start)) return;
  const BoundHandles& handles = state_.handles.bound();
  go_back(start);
  state_.contact.find(start);
  const Index steps = count(longest_motion(), P::small);
  for (Index k = 1; k <= steps; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(steps);
    if (!stays_apart(motions_between(handles, motions_, share), Pull::short_where_held)) break;
  }
  for (int pull = 0; pull < P::most_pulls; ++pull)
    if (!stays_apart(motions_of(handles), Pull::short_for_all)) break;
}

/// Takes a step, and takes it back if parts overlap after it.
bool ContactSolve::stays_apart(const std::vector<Mat4>& motions, Pull pull) {
  Before before(state_);
  step(motions, P::small.iterations, pull);
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
  approach_in_steps(P::small);
  if (!(bad < badness())) return;
  s.shape.coefficients = there;
  s.shape.jump();
  s.contact.restore(std::move(snapshot), s.shape.coefficients);
}

bool ContactSolve::goes_to_its_end() const {
  return iterations_ >= P::patient && !state_.in_one_go && !state_.contact.itself();
}

/// Finds the contact planes near the surface, and projects it out of them at most `pushes` times, while the
/// penetration depth is above the tolerance, below `from`, and decreases.
void ContactSolve::find_and_push(int pushes, double from) {
  RadialState& s = state_;
  double depth = s.contact.find(s.shape.coefficients);
  s.objective(s.fast);
  for (int push = 0; push < pushes && depth > P::depth_tolerance && depth < from; ++push) {
    const RowMatrix<double> before = s.shape.coefficients;
    ContactSnapshot snapshot = s.contact.snapshot();
    push_out(s);
    const double next = s.contact.find(s.shape.coefficients);
    const bool worse = next >= depth;
    if (worse) {
      s.shape.coefficients = before;
      ++s.shape.revision;
      s.contact.restore(std::move(snapshot), s.shape.coefficients);
    }
    s.objective(s.fast);
    if (worse) break;
    depth = next;
  }
}

/// Minimises with fixed contact planes, updates the pressures (augmented-Lagrangian multipliers), and finds
/// new planes. Halves the step from `before` while it penetrates too deeply. Returns whether it converged.
bool ContactSolve::solve_round(const RowMatrix<double>& before, Index iterations) {
  RadialState& s = state_;
  stiffen_contact(s);
  const double allowed = std::max(P::too_deep, s.contact.deepest());
  const bool converged = s.descend(s.fast, {iterations, tolerance_, P::energy_floor}, progress_).converged;
  update_balanced_pressures(s);
  const ContactSnapshot snapshot = s.contact.snapshot();
  double depth = s.contact.find(s.shape.coefficients, std::nullopt);
  bool back = false;
  for (int half = 0; half < P::most_halvings && depth > allowed; ++half) {
    back = true;
    s.shape.coefficients = 0.5 * (s.shape.coefficients + before);
    ++s.shape.revision;
    depth = s.contact.restore(snapshot, s.shape.coefficients);
  }
  return converged && !back;
}

void ContactSolve::sweep() {
  RadialState& s = state_;
  if (s.contact.longest_obstacle_motion() == 0.0) return;
  const auto wanted = static_cast<Index>(std::ceil(s.contact.longest_obstacle_motion() / P::obstacle_step));
  const Index steps = std::clamp<Index>(wanted, 1, P::usual.most_steps);
  const Index at_once = goes_to_its_end() ? P::long_round : P::usual.iterations;
  swept_ = steps > 1;
  s.precondition(0.0);
  for (Index k = 1; k <= steps; ++k) {
    s.contact.move_obstacles(static_cast<double>(k) / static_cast<double>(steps), true);
    find_and_push(1, P::too_deep);
    if (k == steps || !s.contact.has_planes()) continue;
    step(motions_, at_once);
  }
}

void ContactSolve::step(const std::vector<Mat4>& motions, Index iterations, Pull pull) {
  state_.objective(state_.fast);
  held_by_ = set_reachable_targets(state_, motions, pull);
  solve_round(RowMatrix<double>(state_.shape.coefficients), iterations);
}

void ContactSolve::approach_in_steps(const Pace& pace) {
  approach_by(std::max<Index>(count(longest_motion(), pace), 1), pace.iterations);
}

/// In `steps` equal steps, with `on_the_way` iterations in all but the last.
void ContactSolve::approach_by(Index steps, Index on_the_way) {
  RadialState& s = state_;
  s.precondition(0.0);
  const bool to_its_end = (steps > 1 || swept_) && goes_to_its_end();
  if (to_its_end) on_the_way = P::long_round;
  s.contact.find(s.shape.coefficients);
  SolveHistory::Start start{s.shape.coefficients, {}};
  const int uses = s.fast.uses;
  for (Index k = 1; k < steps; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(steps);
    step(motions_between(s.handles.bound(), motions_, share), on_the_way);
  }
  solve_to_targets(motions_between(s.handles.bound(), motions_, 1.0), to_its_end,
                   steps == 1 ? &start : nullptr);
  find_and_push(P::most_projections, P::projected_depth);
  if (s.fast.uses <= uses) start.u.resize(0);
  s.history.start.set(s.start_revisions(), std::move(start));
}

/// Solves in rounds until it converges without penetration, or until the iterations run out and the depth
/// stops decreasing. With a `start`, the first round extrapolates the last change of a drag, and stores there
/// where it would have started.
void ContactSolve::solve_to_targets(const std::vector<Mat4>& motions, bool to_its_end,
                                    SolveHistory::Start* start) {
  RadialState& s = state_;
  const Index in_a_round = to_its_end ? P::long_round : P::round_iterations;
  Index left = iterations_, extra = P::more_rounds;
  double last = std::numeric_limits<double>::infinity(), least = last;
  for (;;) {
    s.objective(s.fast);
    const PointsF places = to_its_end ? sample_places(s) : PointsF();
    held_by_ = set_reachable_targets(s, motions);
    const RowMatrix<double> here = s.shape.coefficients;
    if (start != nullptr && left == iterations_) *start = s.extrapolate();
    const Index at_once = std::clamp<Index>(left, P::least_iterations, in_a_round);
    const Index before = s.report.iterations;
    const bool converged = solve_round(here, at_once);
    left -= to_its_end ? std::max(P::least_iterations, s.report.iterations - before) : at_once;
    const double depth = s.contact.deepest();
    const bool rests = !to_its_end || (sample_places(s) - places).rowwise().norm().maxCoeff() < P::at_rest;
    if (converged && depth < P::depth_tolerance && rests) return;
    s.contact.adapt_stiffness(depth > P::depth_tolerance && depth < P::projected_depth &&
                              depth > P::depth_left * last);
    last = depth;
    if (left <= 0 && (depth < P::depth_tolerance || extra-- == 0)) return;
    if (left <= 0 && s.contact.deepest_outside() < P::depth_tolerance && depth > P::depth_left * least)
      return;
    least = std::min(least, depth);
  }
}

}  // namespace

void solve_in_contact(RadialState& state, Index iterations, double tolerance, const SolveFreely& freely,
                      const Progress& progress) {
  ContactSolve(state, iterations, tolerance, freely, progress).follow();
}

}  // namespace arapfields
