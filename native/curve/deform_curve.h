// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "fields/curve_field.h"
#include "options/curve.h"

namespace arapfields {

/// Samples of the curve (indices) that a rigid motion of the plane, (3,3) homogeneous, is to move.
struct ARAPFIELDS_EXPORT CurveHandle {
  std::vector<Index> samples;
  Mat3 motion = Mat3::Identity();
  double weight = 1.0;

  /// InvalidInput that names, after `prefix`, what no curve has or can follow.
  void validate(const std::string& prefix = "") const;
};

struct CurveReport {
  double stretch = 0.0, bend = 0.0;                        ///< means over the samples, in the square
  double handle_error_mean = 0.0, handle_error_max = 0.0;  ///< in the curve's units
  double min_determinant = 0.0;                            ///< smallest det J at the samples
  Index iterations = 0;                                    ///< quasi-Newton steps taken
  double loss = 0.0;       ///< reached: stretch + λ_bend·bend, handles and smoothness
  bool converged = false;  ///< a further step would gain next to nothing
};

struct CurveSolution {
  CurveField field;
  CurveReport report;
};

/// Deforms a curve (samples (n,2)) as rigidly as possible so that the handles' samples follow their motions:
/// alternating rotations and a linear solve, then quasi-Newton on stretch + λ_bend·bend +
/// handle_weight·handles. Throws InvalidInput for no handles, indices out of range, and motions that are not
/// rigid.
ARAPFIELDS_EXPORT CurveSolution deform_curve(Points2In points, const std::vector<CurveHandle>& handles,
                                             const CurveOptions& options = {}, const Progress& progress = {});

}  // namespace arapfields
