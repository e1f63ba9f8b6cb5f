// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "solve/radial/state.h"

namespace arapfields {

/// Takes handles and obstacles to where they belong, in steps that no sample jumps through anything by.
class ContactApproach {
 public:
  struct Pace {
    double length;         ///< how far a target moves in a step, in cube units
    double length_itself;  ///< the same where the surface meets itself
    Index most_steps;
    Index iterations;  ///< quasi-Newton steps in each but the last
  };
  static constexpr Pace usual{0.15, 0.06, 24, 3};
  /// For where usual steps have little to go by.
  static constexpr Pace small{0.04, 0.03, 60, 10};
  /// What is so deep beyond a margin, in cube units, did not come there by steps.
  static constexpr double too_deep = 0.03;
  /// What is deeper than that, in cube units, is still on its way out.
  static constexpr double nearly = 0.01;

  ContactApproach(RadialState& state, Index iterations, double tolerance, const Progress& progress)
      : state_(state), iterations_(iterations), tolerance_(tolerance), progress_(progress) {}

  /// Takes obstacles that have moved to where they are now, and the surface along. Handles stay at `motions`.
  void sweep(const std::vector<Mat4>& motions);
  /// Takes the handles from `motions` to their targets, which are at most this `way` off.
  void approach(const std::vector<Mat4>& motions, double way, const Pace& pace);
  /// The same in one step.
  void approach_at_once(const std::vector<Mat4>& motions) { approach_by(motions, 1, 0); }
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
  bool swept_ = false;  // obstacles came from far
};

}  // namespace arapfields
