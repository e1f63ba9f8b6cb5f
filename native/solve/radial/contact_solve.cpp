// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_solve.h"

#include <algorithm>
#include <cmath>

#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// How far a target moves in one step, in cube units, and how many steps there are at most.
constexpr double step_length = 0.15;
constexpr Index most_steps = 16;
/// Quasi-Newton steps of each, and between two searches for planes.
constexpr Index steps_on_the_way = 3, steps_between = 6;
/// A surface may be so deep beyond a margin, in cube units.
constexpr double deep = 1e-3;
/// Rounds beyond the iterations that were asked for, while something is deeper.
constexpr Index more_rounds = 2;
/// What single precision cannot see of an energy.
constexpr double floor = 1e-10;

/// Finds planes, descends, and updates the pressures. Whether the descent converged.
bool solve_round(RadialState& s, Index iterations, double tolerance, const Progress& progress) {
  RadialObjective<float>& objective = s.objective(s.fast);
  const VectorF& u = s.measurements(s.fast);
  const Points places = objective.contact_values(u).cast<double>();
  objective.set_contact_stiffness(
      ContactStiffness(s.problem.basis, s.contact.found(), places, s.preconditioner.inverse_factor.latest()));
  const bool converged = s.descend(s.fast, {iterations, tolerance, floor}, progress).converged;
  const Points ends = objective.contact_values(s.measurements(s.fast)).cast<double>();
  s.contact.press(ends.data());
  return converged;
}

}  // namespace

void follow_in_contact(RadialState& s, Index iterations, double tolerance,
                       const std::function<void()>& freely, const Progress& progress) {
  std::vector<Mat4> before = s.dynamics.motions;
  if (std::ssize(before) != s.handles.bound().count()) before = motions_of(s.handles.bound());
  if (!s.contact.presses() && s.contact.find(s.shape.coefficients) <= 0.0) {
    s.contact.release();
    const RowMatrix<double> start = s.shape.coefficients;
    freely();
    if (s.contact.find(s.shape.coefficients) <= 0.0) {
      s.contact.release();
      return;
    }
    s.shape.coefficients = start;
    s.shape.jump();
    s.report.iterations = s.report.evaluations = 0;
  }
  const Points from = s.handles.targets_between(before, 0.0);
  const double way = (s.handles.targets_between(before, 1.0) - from).rowwise().norm().maxCoeff();
  const Index steps = std::clamp<Index>(static_cast<Index>(std::ceil(way / step_length)), 1, most_steps);
  s.precondition(0.0);
  Index left = iterations;
  for (Index k = 1; k <= steps; ++k) {
    const Points targets = s.handles.targets_between(before, static_cast<double>(k) / static_cast<double>(steps));
    for (Index extra = more_rounds;;) {
      s.contact.find(s.shape.coefficients);
      s.objective(s.fast).set_targets(targets);
      const Index at_once = k < steps ? steps_on_the_way : std::clamp<Index>(left, 2, steps_between);
      const bool converged = solve_round(s, at_once, tolerance, progress);
      if (k < steps) break;
      left -= at_once;
      const double depth = s.contact.find(s.shape.coefficients);
      if (converged && depth < deep) break;
      if (left <= 0 && (depth < deep || extra-- == 0)) break;
    }
  }
  s.report.contact = s.contact.report();
  s.report.contact.unsettled = s.report.contact.deepest > deep;
  s.report.contact.deepest *= s.problem.frame().scale;
}

}  // namespace arapfields
