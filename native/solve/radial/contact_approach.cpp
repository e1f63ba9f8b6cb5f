// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_approach.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "solve/radial/contact_forces.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Longest motion of an obstacle in a step, in cube units.
constexpr double obstacle_step = 0.02;
/// Quasi-Newton iterations between two searches for contact planes, and the fewest a round is charged for.
constexpr Index steps_between = 6, least_at_once = 2;
/// Solves of at least `patient` iterations that take several steps run to convergence, so that rounding
/// changes the result less: rounds of `steps_to_the_end` iterations, until a round moves no sample by more
/// than `at_rest`, in cube units. Not with self-contact: handles that meet would block each other.
constexpr Index patient = 30, steps_to_the_end = 20;
constexpr double at_rest = 1e-3;
/// Projections at the end, while the penetration depth is between ContactSet::deep and `nearly`.
constexpr int most_pushes = 6;
/// Rounds beyond the requested iterations while points penetrate; with self-contact alone, only while the
/// depth decreases.
constexpr Index more_rounds = 4;
/// A depth decreases if a round leaves at most this fraction of it; otherwise the stiffness is raised.
constexpr double still_comes_out = 0.8;
/// A round that ends too deep is rejected, and its step halved at most so many times.
constexpr int most_halves = 4;
/// Relative change of the energy below the resolution of single precision.
constexpr double floor = 1e-10;
constexpr double deep = ContactSet::deep;

PointsF sample_places(RadialState& s) { return s.objective(s.fast).sample_values(s.measurements(s.fast)); }

}  // namespace

bool ContactApproach::goes_to_its_end() const {
  return iterations_ >= patient && !state_.in_one_go && !state_.contact.itself();
}

/// Finds the contact planes near the surface, and projects it out of them at most `pushes` times, while the
/// penetration depth is above ContactSet::deep, below `from`, and decreases.
void ContactApproach::find_and_push(int pushes, double from) {
  RadialState& s = state_;
  double depth = s.contact.find(s.shape.coefficients);
  s.objective(s.fast);
  for (int push = 0; push < pushes && depth > deep && depth < from; ++push) {
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
bool ContactApproach::solve_round(const RowMatrix<double>& before, Index iterations) {
  RadialState& s = state_;
  stiffen_contact(s);
  const double allowed = std::max(too_deep, s.contact.deepest());
  const bool converged = s.descend(s.fast, {iterations, tolerance_, floor}, progress_).converged;
  update_balanced_pressures(s);
  const ContactSnapshot snapshot = s.contact.snapshot();
  double depth = s.contact.find(s.shape.coefficients, std::nullopt);
  bool back = false;
  for (int half = 0; half < most_halves && depth > allowed; ++half) {
    back = true;
    s.shape.coefficients = 0.5 * (s.shape.coefficients + before);
    ++s.shape.revision;
    depth = s.contact.restore(snapshot, s.shape.coefficients);
  }
  return converged && !back;
}

void ContactApproach::sweep(const std::vector<Mat4>& motions) {
  RadialState& s = state_;
  if (s.contact.longest_obstacle_motion() == 0.0) return;
  const auto wanted = static_cast<Index>(std::ceil(s.contact.longest_obstacle_motion() / obstacle_step));
  const Index steps = std::clamp<Index>(wanted, 1, usual.most_steps);
  const Index at_once = goes_to_its_end() ? steps_to_the_end : usual.iterations;
  swept_ = steps > 1;
  s.precondition(0.0);
  for (Index k = 1; k <= steps; ++k) {
    s.contact.move_obstacles(static_cast<double>(k) / static_cast<double>(steps), true);
    find_and_push(1, too_deep);
    if (k == steps || !s.contact.has_planes()) continue;
    step(motions, at_once);
  }
}

void ContactApproach::step(const std::vector<Mat4>& motions, Index iterations, Pull pull) {
  state_.objective(state_.fast);
  held_by_ = set_reachable_targets(state_, motions, pull);
  solve_round(RowMatrix<double>(state_.shape.coefficients), iterations);
}

void ContactApproach::approach(const std::vector<Mat4>& motions, double distance, const Pace& pace) {
  approach_by(motions, std::max<Index>(count(distance, pace), 1), pace.iterations);
}

Index ContactApproach::count(double distance, const Pace& pace) const {
  return std::min(static_cast<Index>(std::ceil(distance / length(pace))), pace.most_steps);
}

/// In `steps` equal steps, with `on_the_way` iterations in all but the last.
void ContactApproach::approach_by(const std::vector<Mat4>& motions, Index steps, Index on_the_way) {
  RadialState& s = state_;
  s.precondition(0.0);
  const bool to_its_end = (steps > 1 || swept_) && goes_to_its_end();
  if (to_its_end) on_the_way = steps_to_the_end;
  s.contact.find(s.shape.coefficients);
  SolveHistory::Start start{s.shape.coefficients, {}};
  const int uses = s.fast.uses;
  for (Index k = 1; k < steps; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(steps);
    step(motions_between(s.handles.bound(), motions, share), on_the_way);
  }
  solve_to_targets(motions_between(s.handles.bound(), motions, 1.0), to_its_end,
                   steps == 1 ? &start : nullptr);
  find_and_push(most_pushes, nearly);
  if (s.fast.uses <= uses) start.u.resize(0);
  s.history.start.set(s.start_revisions(), std::move(start));
}

/// Solves in rounds until it converges without penetration, or until the iterations run out and the depth
/// stops decreasing. With a `start`, the first round extrapolates the last change of a drag, and stores there
/// where it would have started.
void ContactApproach::solve_to_targets(const std::vector<Mat4>& motions, bool to_its_end,
                                       SolveHistory::Start* start) {
  RadialState& s = state_;
  const Index in_a_round = to_its_end ? steps_to_the_end : steps_between;
  Index left = iterations_, extra = more_rounds;
  double last = std::numeric_limits<double>::infinity(), least = last;
  for (;;) {
    s.objective(s.fast);
    const PointsF places = to_its_end ? sample_places(s) : PointsF();
    held_by_ = set_reachable_targets(s, motions);
    const RowMatrix<double> here = s.shape.coefficients;
    if (start != nullptr && left == iterations_) *start = s.extrapolate();
    const Index at_once = std::clamp<Index>(left, least_at_once, in_a_round);
    const Index before = s.report.iterations;
    const bool converged = solve_round(here, at_once);
    left -= to_its_end ? std::max(least_at_once, s.report.iterations - before) : at_once;
    const double depth = s.contact.deepest();
    const bool rests = !to_its_end || (sample_places(s) - places).rowwise().norm().maxCoeff() < at_rest;
    if (converged && depth < deep && rests) return;
    s.contact.adapt_stiffness(depth > deep && depth < nearly && depth > still_comes_out * last);
    last = depth;
    if (left <= 0 && (depth < deep || extra-- == 0)) return;
    if (left <= 0 && s.contact.deepest_outside() < deep && depth > still_comes_out * least) return;
    least = std::min(least, depth);
  }
}

}  // namespace arapfields
