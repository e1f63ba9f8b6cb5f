// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "sampling/evaluation_counter.h"

namespace arapfields {

/// Unit normals at points of {Φ = 0}. If ∇Φ does not agree with finite differences of Φ (noise, quantised
/// distances), they are central differences with the smallest step that agrees with twice the step.
class SurfaceNormals {
 public:
  explicit SurfaceNormals(EvaluationCounter& function) : function_(function) {}

  /// Normals (n,3), from ∇Φ at the points; a row of zeros where Φ is locally constant. The points of the
  /// first call determine the step.
  Points operator()(const PointsF& points, const PointsF& gradients);

 private:
  Points differences(const PointsF& points, double step);
  void choose_step(const PointsF& points, const Points& gradients);

  EvaluationCounter& function_;
  bool chosen_ = false;
  double step_ = 0.0;  // 0: gradients are used
};

}  // namespace arapfields
