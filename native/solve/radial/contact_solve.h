// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "solve/radial/contact_approach.h"
#include "solve/radial/state.h"

namespace arapfields {

/// A solve outside of the contact's obstacles, from the shape and the targets of the last one. It tries in
/// turn: a solve without contact, if that comes near nothing; to push apart the parts that overlap after it;
/// and to approach the targets by steps.
class ContactSolve {
 public:
  /// Solves without contact, in so many steps.
  using Freely = std::function<void(Index)>;
  ContactSolve(RadialState& state, Index iterations, double tolerance, Freely freely,
               const Progress& progress);
  void follow();

 private:
  void start_at_rest();
  double way() const;
  bool comes_apart();
  bool starts_better(const RowMatrix<double>& coefficients);
  bool may_be_clear() const;
  bool ends_clear();
  bool pushes_apart();
  void approach(bool slowly);
  void approach_again_slowly(const RowMatrix<double>& start);
  void go_back(const RowMatrix<double>& coefficients);

  RadialState& state_;
  Index iterations_;
  Freely freely_;
  ContactApproach steps_;
  std::vector<Mat4> motions_;  // of the handles, that the shape was solved for
};

}  // namespace arapfields
