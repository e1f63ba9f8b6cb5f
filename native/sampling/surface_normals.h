// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "sampling/evaluation_counter.h"

namespace arapfields {

/// Unit normals at points of {Φ = 0}. Where ∇Φ does not agree with differences of Φ (noise, steps of a
/// quantised distance), they come from differences over the least step that agrees with its double.
class SurfaceNormals {
 public:
  explicit SurfaceNormals(EvaluationCounter& function) : function_(function) {}

  /// (n,3), from ∇Φ at the points; a row of zeros where Φ is flat all around. The first points decide on the
  /// step.
  Points operator()(const PointsF& points, const PointsF& gradients);

 private:
  Points differences(const PointsF& points, double step);
  void choose_step(const PointsF& points, const Points& gradients);

  EvaluationCounter& function_;
  bool chosen_ = false;
  double step_ = 0.0;  // 0: gradients serve
};

}  // namespace arapfields
