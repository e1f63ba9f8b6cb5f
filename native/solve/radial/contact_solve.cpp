// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_solve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// How the targets are approached: how far one moves in a step, in cube units, the same where the surface
/// meets itself, how many steps there are at most, and quasi-Newton steps in each.
struct Pace {
  double length, length_itself;
  Index most_steps, iterations;
};
constexpr Pace usual{0.15, 0.06, 24, 3};
/// Tried as well where usual steps have little to go by: in a solve in one go that ends with parts in each
/// other, or begins with an obstacle across the surface.
constexpr Pace small{0.04, 0.03, 60, 10};
/// The same of obstacles.
constexpr double obstacle_step = 0.02;
/// Quasi-Newton steps between two searches for planes.
constexpr Index steps_between = 6;
/// Solves of so many iterations whose handles or obstacles come from far go on to their end, where rounding
/// changes less: so many quasi-Newton steps each time, until a round moves no sample
/// farther, in cube units. Not where the surface meets itself: handles that meet would stop each other.
constexpr Index patient = 30, steps_to_the_end = 20;
constexpr double at_rest = 1e-3;
/// A surface may be so deep beyond a margin, in cube units.
constexpr double deep = 5e-4;
/// Pushes at the end, while something is deeper, but not so deep that it is still on its way.
constexpr int most_pushes = 6;
constexpr double nearly = 0.01;
/// Rounds beyond the iterations that were asked for, while something is deeper; of the shape itself, only
/// while that falls.
constexpr Index more_rounds = 4;
/// Depths fall where a round leaves no more than this share. Planes become stiffer where they do not.
constexpr double still_comes_out = 0.8;
/// A round that ends so deep, in cube units, is taken back by halves, so many times at most.
constexpr double too_deep = 0.03;
constexpr int most_halves = 4;
/// Handles farther from their targets against a force, in cube units, are held back.
constexpr double held_back = 0.02;
/// Steps without contact at most, where the shape itself holds a handle back.
constexpr Index steps_apart = 60;
/// A shape on another way is better if it has less energy by that share.
constexpr double better = 0.01;
/// What single precision cannot see of an energy.
constexpr double floor = 1e-10;

/// Finds the planes near the surface, and brings it beyond them as long as it is deep.
double find_and_push(RadialState& s, int pushes, double from) {
  double depth = s.contact.find(s.shape.coefficients);
  s.objective(s.fast);
  for (int push = 0; push < pushes && depth > deep && depth < from; ++push) {
    const RowMatrix<double> before = s.shape.coefficients;
    const ContactWays ways = s.contact.ways();
    push_out(s);
    const double next = s.contact.find(s.shape.coefficients);
    const bool worse = next >= depth;
    if (worse) {
      s.shape.coefficients = before;
      ++s.shape.revision;
      s.contact.set_ways(ways);
      s.contact.find(s.shape.coefficients);
    }
    s.objective(s.fast);
    if (worse) break;
    depth = next;
  }
  return depth;
}

/// Descends, and updates the pressures. Whether the descent converged. Goes back towards `before` where that
/// meets what was not near there.
bool solve_round(RadialState& s, const RowMatrix<double>& before, Index iterations, double tolerance,
                 const Progress& progress) {
  stiffen_contact(s);
  const double allowed = std::max(too_deep, s.contact.deepest());
  const bool converged = s.descend(s.fast, {iterations, tolerance, floor}, progress).converged;
  press_balanced(s);
  const ContactWays ways = s.contact.ways();
  double depth = s.contact.find(s.shape.coefficients, std::nullopt);
  bool back = false;
  for (int half = 0; half < most_halves && depth > allowed; ++half) {
    back = true;
    s.shape.coefficients = 0.5 * (s.shape.coefficients + before);
    ++s.shape.revision;
    s.contact.set_ways(ways);
    depth = s.contact.find(s.shape.coefficients);
  }
  return converged && !back;
}

/// How the surface touches, and which handles are kept from their targets.
void report_contact(RadialState& s) {
  const double scale = s.problem.frame().scale;
  ContactReport& report = s.report.contact;
  report = {scale * s.contact.deepest(), s.contact.found().touching(), s.contact.deepest() > deep, {}, {}};
  const RadialObjective<float>& objective = s.objective(s.fast);  // of the planes that were found last
  const Points places = contact_places(s);
  const Points values = objective.handle_values(s.measurements(s.fast)).cast<double>();
  const Points& targets = s.handles.pairs().targets;
  const Index own = s.handles.any() ? s.handles.own_count() : 0;
  std::vector<Mat4> motions = motions_of(s.handles.bound());
  const std::vector<Index> surfaces = hold_back(s, motions);
  for (Index first = 0, last = 0; first < own; first = last) {
    const Index handle = s.handles.handle_of(first);
    while (last < own && s.handles.handle_of(last) == handle) ++last;
    const Points left = (targets - values).middleRows(first, last - first);
    const double distance = left.rowwise().norm().mean();
    if (distance < held_back) continue;
    const Vec3 middle = values.middleRows(first, last - first).colwise().mean();
    const Vector along = s.contact.found().forces_at(middle, places.data(), s.contact.surface_count()) *
                         left.colwise().mean().transpose();
    Index by = 0;
    const bool pressed = along.minCoeff(&by) < 0.0;
    const Index back = surfaces[static_cast<std::size_t>(handle)];
    if (back >= 0 || pressed)
      report.held.push_back({handle, s.contact.name_of(back >= 0 ? back : by), scale * distance});
  }
}

bool goes_to_its_end(const RadialState& s, Index iterations) {
  return iterations >= patient && !s.in_one_go && !s.contact.itself();
}

PointsF sample_places(RadialState& s) { return s.objective(s.fast).sample_values(s.measurements(s.fast)); }

/// Takes the handles from earlier motions to their targets in so many steps, with `on_the_way` iterations in
/// all but the last.
void approach(RadialState& s, const std::vector<Mat4>& before, Index steps, Index on_the_way,
              Index iterations, double tolerance, const Progress& progress) {
  s.precondition(0.0);
  Index left = iterations;
  const bool to_its_end = steps > 1 && goes_to_its_end(s, iterations);
  const Index in_a_round = to_its_end ? steps_to_the_end : steps_between;
  if (to_its_end) on_the_way = steps_to_the_end;
  double before_it = std::numeric_limits<double>::infinity(), least = before_it;
  s.contact.find(s.shape.coefficients);
  SolveHistory::Start start{s.shape.coefficients, {}};
  const int uses = s.fast.uses;
  for (Index k = 1; k <= steps; ++k) {
    const std::vector<Mat4> wanted =
        motions_between(s.handles.bound(), before, static_cast<double>(k) / static_cast<double>(steps));
    for (Index extra = more_rounds;;) {
      s.objective(s.fast);
      const PointsF places = to_its_end ? sample_places(s) : PointsF();
      set_reachable_targets(s, wanted);
      const RowMatrix<double> here = s.shape.coefficients;
      if (steps == 1 && extra == more_rounds) start = s.extrapolate();
      const Index at_once = k < steps ? on_the_way : std::clamp<Index>(left, 2, in_a_round);
      const bool converged = solve_round(s, here, at_once, tolerance, progress);
      if (k < steps) break;
      left -= at_once;
      const double depth = s.contact.deepest();
      const bool rests = !to_its_end || (sample_places(s) - places).rowwise().norm().maxCoeff() < at_rest;
      if (converged && depth < deep && rests) break;
      s.contact.harden(depth > deep && depth < nearly && depth > still_comes_out * before_it);
      before_it = depth;
      if (left <= 0 && (depth < deep || extra-- == 0)) break;
      if (left <= 0 && s.contact.deepest_outside() < deep && depth > still_comes_out * least) break;
      least = std::min(least, depth);
    }
  }
  find_and_push(s, most_pushes, nearly);
  if (s.fast.uses <= uses) start.u.resize(0);
  s.history.start.set(s.start_revisions(), std::move(start));
}

/// Takes obstacles that have moved to where they are now, and the surface along.
void sweep(RadialState& s, const std::vector<Mat4>& motions, Index iterations, double tolerance,
           const Progress& progress) {
  if (s.contact.obstacle_way() == 0.0) return;
  const auto wanted = static_cast<Index>(std::ceil(s.contact.obstacle_way() / obstacle_step));
  const Index parts = std::clamp<Index>(wanted, 1, usual.most_steps);
  const Index at_once = goes_to_its_end(s, iterations) ? steps_to_the_end : usual.iterations;
  s.precondition(0.0);
  for (Index k = 1; k <= parts; ++k) {
    s.contact.move_obstacles(static_cast<double>(k) / static_cast<double>(parts));
    find_and_push(s, 1, too_deep);
    if (k == parts || !s.contact.presses()) continue;
    s.objective(s.fast);
    set_reachable_targets(s, motions);
    solve_round(s, RowMatrix<double>(s.shape.coefficients), at_once, tolerance, progress);
  }
}

void back_to(RadialState& s, const RowMatrix<double>& coefficients) {
  s.shape.coefficients = coefficients;
  s.shape.jump();
  s.contact.begin(coefficients);
}

/// What is minimised, but for contact.
double value_without_contact(RadialState& s) {
  const RadialObjective<float>& objective = s.objective(s.fast);
  const VectorF& u = s.measurements(s.fast);
  return objective.value(u, nullptr) - objective.terms(u).contact;
}

/// Starts at these coefficients if they have less energy without contact.
bool start_better(RadialState& s, const RowMatrix<double>& coefficients) {
  const double value = value_without_contact(s);
  const RowMatrix<double> before = std::exchange(s.shape.coefficients, coefficients);
  s.shape.jump();
  if (value_without_contact(s) < value) return true;
  s.shape.coefficients = before;
  ++s.shape.revision;
  return false;
}

/// Where the shape itself holds a handle back, a detour may have brought the surface there: solves without
/// contact, and where the handles rest, pushes apart what overlaps then. Returns whether that is better; if
/// not, all is as before.
bool come_apart(RadialState& s, const std::vector<Mat4>& before, bool rests, Index iterations,
                double tolerance, const std::function<void(Index)>& freely, const Progress& progress) {
  const std::vector<HeldBack>& held = s.report.contact.held;
  const Points& targets = s.handles.pairs().targets;
  if (std::none_of(held.begin(), held.end(), [](const HeldBack& h) { return h.by == "itself"; })) {
    s.tried = {};
    return false;
  }
  const bool again = s.tried.targets.rows() == targets.rows();
  if (again && (targets - s.tried.targets).rowwise().norm().maxCoeff() <= (rests ? 0.0 : usual.length_itself))
    return false;
  const double value = value_without_contact(s);
  const RadialShape shape = s.shape;
  const SolveHistory history = s.history;
  const RadialReport report = s.report;
  ContactPressing pressing = s.contact.pressing();
  s.contact.release();
  const bool goes_on = again && start_better(s, s.tried.coefficients);
  freely(goes_on ? std::min(2 * iterations, steps_apart) : steps_apart);
  s.tried = {targets, s.shape.coefficients};
  s.report.contact = {};
  if (s.contact.find(s.shape.coefficients, 0.0, true) <= 0.0) {
    s.contact.release();
    if (!s.contact.overlaps(s.shape.coefficients)) return true;
  } else if (rests && s.contact.deepest_outside() <= 0.0) {
    approach(s, before, 1, 0, iterations, tolerance, progress);
    report_contact(s);
    if (!s.contact.overlaps(s.shape.coefficients) && value_without_contact(s) < (1.0 - better) * value)
      return true;
  }
  s.shape.coefficients = shape.coefficients;
  s.shape.jumps = shape.jumps;
  ++s.shape.revision;
  s.history = history;
  s.report = report;
  s.contact.set_pressing(std::move(pressing));
  s.contact.find(s.shape.coefficients);
  return false;
}

}  // namespace

Points contact_places(RadialState& s) {
  const VectorF& u = s.measurements(s.fast);
  return s.fast.objective.latest()->contact_values(u).cast<double>();
}

bool is_deep(RadialState& s) {
  const Points places = contact_places(s);
  return std::any_of(s.contact.found().planes.begin(), s.contact.found().planes.end(),
                     [&](const ContactPlane& p) { return p.gap(places.data()) < -3.0 * deep; });
}

double press_contact(RadialState& s) {
  if (!s.contact.presses()) return 0.0;
  return s.contact.press(contact_places(s).data(), Vector::Ones(s.contact.surface_count()));
}

void follow_in_contact(RadialState& s, Index iterations, double tolerance,
                       const std::function<void(Index)>& freely, const Progress& progress) {
  std::vector<Mat4> before = s.dynamics.motions;
  if (std::ssize(before) != s.handles.bound().count()) {
    before = motions_of(s.handles.bound());
    if (s.shape.coefficients == s.problem.basis.identity()) before.assign(before.size(), Mat4::Identity());
  }
  const bool goes_on = s.contact.ended_at(s.shape.revision);
  sweep(s, before, iterations, tolerance, progress);
  const bool pressed = s.contact.presses();
  s.contact.find(s.shape.coefficients);
  if (!goes_on && s.contact.deepest_outside() > too_deep) {
    back_to(s, s.problem.basis.identity());  // what was not followed here is followed from rest
    before.assign(before.size(), Mat4::Identity());
  }
  const Points from = s.handles.targets_at(motions_between(s.handles.bound(), before, 0.0));
  const double way = (s.handles.pairs().targets - from).rowwise().norm().maxCoeff();
  if (come_apart(s, before, way == 0.0, iterations, tolerance, freely, progress)) return;
  const auto length = [&](const Pace& pace) { return s.contact.itself() ? pace.length_itself : pace.length; };
  bool slowly = s.in_one_go && !s.contact.crossing().empty();
  RowMatrix<double> start;  // where parts were pushed apart that a free solve let overlap
  const bool leaps = s.contact.only_itself() && way > length(usual);  // the way back may be another one
  if (leaps || (!pressed && s.contact.deepest() <= 0.0 && !s.contact.touches_itself())) {
    s.contact.release();
    start = s.shape.coefficients;
    freely(iterations);
    s.report.contact = {};
    if (s.contact.find(s.shape.coefficients, 0.0, true) <= 0.0) {
      s.contact.release();
      return;
    }
    if (s.contact.deepest_outside() > 0.0) back_to(s, std::exchange(start, {}));
    s.report.iterations = s.report.evaluations = 0;
  }
  if (start.size() > 0) {
    approach(s, before, 1, 0, iterations, tolerance, progress);
    if (!s.contact.overlaps(s.shape.coefficients)) return report_contact(s);
    back_to(s, start);
    slowly = s.in_one_go;
  }
  const RowMatrix<double> begun = s.shape.coefficients;
  const auto approach_at = [&](const Pace& pace) {
    const auto parts = static_cast<Index>(std::ceil(way / length(pace)));
    approach(s, before, std::clamp<Index>(parts, 1, pace.most_steps), pace.iterations, iterations, tolerance,
             progress);
  };
  approach_at(usual);
  if (slowly && way > length(small)) {
    const auto badness = [&] {
      const bool inside = s.contact.deepest_outside() > nearly || s.contact.overlaps(s.shape.coefficients);
      return std::pair(inside, value_without_contact(s));
    };
    const std::pair<bool, double> bad = badness();
    const RowMatrix<double> there = s.shape.coefficients;
    ContactPressing pressing = s.contact.pressing();
    back_to(s, begun);
    approach_at(small);
    if (bad < badness()) {
      back_to(s, there);
      s.contact.set_pressing(std::move(pressing));
      s.contact.find(s.shape.coefficients);
    }
  }
  report_contact(s);
}

}  // namespace arapfields
