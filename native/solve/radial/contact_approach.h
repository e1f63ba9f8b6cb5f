// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solve/radial/contact_handles.h"
#include "solve/radial/state.h"

namespace arapfields {

/// Continuation for a solve in contact: moves handles to their targets and obstacles to their placements in
/// steps so small that no sample tunnels through a surface, with a few quasi-Newton iterations after each.
class ContactApproach {
 public:
  struct Pace {
    double length;         ///< longest motion of a handle's target in a step, in cube units
    double length_itself;  ///< the same with self-contact
    Index most_steps;
    Index iterations;  ///< quasi-Newton iterations in each step but the last
  };
  static constexpr Pace usual{0.15, 0.06, 24, 3};
  /// For a second try from the same start, where the usual steps may choose the wrong side.
  static constexpr Pace small{0.04, 0.03, 60, 10};
  /// Penetration depth beyond a margin, in cube units, above which a step is rejected and shortened.
  static constexpr double too_deep = 0.03;
  /// Penetration depth, in cube units, up to which the final projections push points out.
  static constexpr double nearly = 0.01;

  ContactApproach(RadialState& state, Index iterations, double tolerance, const Progress& progress)
      : state_(state), iterations_(iterations), tolerance_(tolerance), progress_(progress) {}

  /// Moves the obstacles from their last placements to the current ones, and the surface out of their way.
  /// The handles stay at `motions`.
  void sweep(const std::vector<Mat4>& motions);
  /// Moves the handles from `motions` to their targets; `distance` is the longest way, in cube units.
  void approach(const std::vector<Mat4>& motions, double distance, const Pace& pace);
  /// The same in one step.
  void approach_at_once(const std::vector<Mat4>& motions) { approach_by(motions, 1, 0); }
  /// One step: quasi-Newton iterations with the handles' targets at `motions`, and a search for planes.
  void step(const std::vector<Mat4>& motions, Index iterations, Pull pull = Pull::short_where_held);
  /// Number of steps in which handles move by this distance, in cube units.
  Index count(double distance, const Pace& pace) const;
  /// The surfaces that held the handles back in the last solve.
  const std::vector<Index>& held_by() const { return held_by_; }
  double length(const Pace& pace) const { return state_.contact.itself() ? pace.length_itself : pace.length; }

 private:
  void approach_by(const std::vector<Mat4>& motions, Index steps, Index on_the_way);
  void solve_to_targets(const std::vector<Mat4>& motions, bool to_its_end, SolveHistory::Start* start);
  bool solve_round(const RowMatrix<double>& before, Index iterations);
  void find_and_push(int pushes, double from);
  bool goes_to_its_end() const;

  RadialState& state_;
  Index iterations_;
  double tolerance_;
  const Progress& progress_;
  std::vector<Index> held_by_;
  bool swept_ = false;  // the last sweep took more than one step
};

}  // namespace arapfields
