// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "core/errors.h"
#include "core/task.h"
#include "neural/neural_sdf.h"
#include "optimize/iteration.h"
#include "options/fit.h"

namespace arapfields {

/// Absolute errors against the exact distance at points that were not learnt from, in mesh units.
struct FitReport {
  double near_mean = 0, near_max = 0;      ///< near the surface, distributed as the training points are
  double volume_mean = 0, volume_max = 0;  ///< uniform in the cube
  double scale = 1;                        ///< mesh units a cube unit
  int iterations = 0;
  double seconds = 0, distance_seconds = 0;  ///< all, and the part spent on exact distances
  StopReason stopped_by = StopReason::iterations;
  std::string device;
};

struct FitResult {
  std::shared_ptr<NeuralSdf> sdf;
  FitReport report;
};

/// Training met NaN or infinity; the state before is kept.
class ARAPFIELDS_EXPORT FitDiverged : public Diverged {
 public:
  FitDiverged(const std::string& what, FitResult good) : Diverged(what), last_good(std::move(good)) {}
  FitResult last_good;
};

/// Fits a network to the signed distance of a triangle soup (vertices (n,3), triangles (m,3)), in the frame
/// that centres it and scales it to half-extent 0.75. An observer receives one term, error. Throws
/// InvalidInput, FitDiverged, Cancelled.
ARAPFIELDS_EXPORT FitResult fit_sdf(PointsIn vertices, TrianglesIn triangles, const FitOptions& options = {},
                                    const Progress& progress = {}, const IterationObserver& observer = {});

}  // namespace arapfields
