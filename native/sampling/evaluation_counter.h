// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/implicit.h"
#include "core/task.h"

namespace arapfields {

/// Evaluates an ImplicitFunction in batches small enough to cancel promptly, and counts the points.
/// A value or gradient that is not finite throws InvalidInput("sdf", …).
class EvaluationCounter {
 public:
  EvaluationCounter(const ImplicitFunction& function, const Progress& progress)
      : function_(function), progress_(progress) {}

  VectorF values(ConstPointsRef<float> points);
  VectorF values(ConstPointsRef<float> points, PointsF& gradients);

  std::optional<double> gradient_bound() const { return function_.gradient_bound(); }
  bool continuous() const { return function_.continuous(); }
  const Progress& progress() const { return progress_; }
  Index value_count() const { return value_count_; }
  Index gradient_count() const { return gradient_count_; }

 private:
  const ImplicitFunction& function_;
  Progress progress_;
  Index value_count_ = 0;
  Index gradient_count_ = 0;
};

/// A bound on |∇Φ| over the cube: the largest of a stratified sample of gradients (strata³ of them,
/// jittered), times a safety factor of 1.25. The largest of 40,000 gradients of the published networks
/// is 1.04 to 1.23 times that of such a sample. TricubicSurrogate raises the bound if grid values contradict
/// it. For a discontinuous function the steepest tenth, which may be at jumps, is left out.
double measure_lipschitz(EvaluationCounter& function, int strata = 12);

}  // namespace arapfields
