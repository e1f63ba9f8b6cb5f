// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/errors.h"
#include "core/task.h"
#include "neural/neural_sdf.h"

namespace arapfields {

/// How a network learns a mesh's signed distance. Lengths are in units of the cube, in which the mesh
/// spans 1.5.
struct FitOptions {
  int octaves = 4;
  double frequency = 1.0;
  int width = 256;
  int layers = 4;
  double sharpness = 30.0;

  int steps = 400;
  int batch = 1024;                ///< points a step
  double seconds = 0.0;            ///< time budget, which the schedule then follows; 0: none
  double target_error = 0.0;       ///< stop at this mean error near the surface; 0: never
  std::string optimizer = "muon";  ///< or "adam"
  double learning_rate = 0.0;      ///< at its peak; 0: 0.05 for muon, 0.003 for adam

  int near_points = 150000;  ///< near the surface, half of them with each of the two spreads
  int uniform_points = 40000;
  double near_spread = 0.01;  ///< standard deviation of the distance to the surface along each axis
  double far_spread = 0.05;
  double near_share = 0.8;  ///< of each batch

  int threads = 0;              ///< 0: those in force
  std::string device = "auto";  ///< "cpu", "cuda", or "auto": a CUDA device if there is one
  std::uint64_t seed = 0;
};

/// Absolute errors against the exact distance at points that were not learnt from, in mesh units.
struct FitReport {
  double near_mean = 0, near_max = 0;      ///< near the surface, distributed as the training points are
  double volume_mean = 0, volume_max = 0;  ///< uniform in the cube
  double scale = 1;                        ///< mesh units a cube unit
  int steps = 0;
  double seconds = 0, distance_seconds = 0;  ///< all, and the part spent on exact distances
  std::string stopped_by;                    ///< "steps", "seconds", "target_error", "diverged"
  std::string device;
};

struct FitResult {
  std::shared_ptr<NeuralSdf> sdf;
  FitReport report;
};

/// Training left the finite numbers; the state before is kept.
class FitDiverged : public Diverged {
 public:
  FitDiverged(const std::string& what, FitResult good) : Diverged(what), last_good(std::move(good)) {}
  FitResult last_good;
};

/// Fits a network to the signed distance of a triangle soup (vertices (n,3), triangles (m,3)), in the frame
/// that centres it and scales it to half-extent 0.75. Throws InvalidInput, FitDiverged, Cancelled.
FitResult fit_sdf(PointsIn vertices, TrianglesIn triangles, const FitOptions& options = {},
                  const Progress& progress = {});

}  // namespace arapfields
