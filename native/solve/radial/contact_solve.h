// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "solve/radial/contact_approach.h"
#include "solve/radial/state.h"

namespace arapfields {

/// A solve with contact constraints, from the shape and the targets of the last one. It tries in turn: one
/// without contact, accepted if nothing penetrates after it; a projection that separates the parts which
/// overlap after that; and continuation towards the targets (ContactApproach).
class ContactSolve {
 public:
  /// Solves without contact, in at most so many iterations.
  using Freely = std::function<void(Index)>;
  ContactSolve(RadialState& state, Index iterations, double tolerance, Freely freely,
               const Progress& progress);
  void follow();

 private:
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

  RadialState& state_;
  Index iterations_;
  Freely freely_;
  ContactApproach steps_;
  std::vector<Mat4> motions_;  // of the handles, for which the current shape was solved
};

}  // namespace arapfields
