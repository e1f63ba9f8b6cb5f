// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/fit.h"

#include <cmath>
#include <cstdio>

#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/task.h"
#include "distance/training_points.h"
#include "mesh/outward_triangles.h"
#include "mesh/sample_mesh.h"
#include "neural/layers.h"
#include "neural/mlp.h"
#include "optimize/training_loop.h"
#include "tensors/device.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// What a training point and its distance take while they are made.
constexpr double example_bytes = 100.0;

/// Points and distances on the network's device, the near-surface ones first.
struct Examples {
  Examples(const TrainingPoints& given, const Tensor& like)
      : points(tensor_like(given.points, like)),
        distances(tensor_like(given.distances, like)),
        near_count(given.near_surface) {}
  Index count() const { return points.size(0); }

  Tensor points, distances;
  Index near_count;
};

/// Random rows of the examples, near_share of them near the surface.
class Batches {
 public:
  Batches(const Examples& examples, const FitOptions& options)
      : examples_(examples),
        near_(std::llround(options.near_share * options.training.batch)),
        random_(options.training.seed, 0xba7c4),
        rows_(empty({options.training.batch}, NumberType::int64)) {}

  void next() {
    Index* rows = rows_.data<Index>();
    for (Index i = 0; i < rows_.size(0); ++i)
      rows[i] = i < near_ ? random_.below(examples_.near_count)
                          : examples_.near_count + random_.below(examples_.count() - examples_.near_count);
    const Tensor where = upload(rows_, examples_.points);
    points = index_select(examples_.points, 0, where);
    distances = index_select(examples_.distances, 0, where);
  }
  Tensor points, distances;

 private:
  const Examples& examples_;
  Index near_;
  Random random_;
  Tensor rows_;
};

struct Errors {
  double mean = 0, max = 0;
};

Errors errors(const Mlp& mlp, const Tensor& points, const Tensor& distances) {
  const Tensor off = abs(mlp.evaluate(points, JetOrder::value).flat() - distances);
  return {mean(off).number(), max(off).number()};
}

/// The mean absolute error of a batch.
class Fit final : public LoopBody {
 public:
  Fit(const FitOptions& options, Mlp& mlp, const Examples& examples, const Examples& held_out)
      : options_(options), mlp_(mlp), held_out_(held_out), batches_(examples, options) {}

  Tensor accumulate(int) override {
    batches_.next();
    const Tensor off = mlp_.forward(batches_.points, JetOrder::value).flat() - batches_.distances;
    mlp_.pull_back((sign(off) / static_cast<double>(options_.training.batch)).view({1, -1, 1}));
    return error_ = mean(abs(off));
  }
  bool is_finite() override {
    return std::isfinite(errors(mlp_, held_out_.points, held_out_.distances).mean);
  }
  bool is_good_enough() override {
    if (options_.target_error <= 0) return false;
    const Index some = std::min<Index>(held_out_.near_count, 4096);
    return errors(mlp_, held_out_.points.narrow(0, 0, some), held_out_.distances.narrow(0, 0, some)).mean <=
           options_.target_error;
  }
  std::vector<LossTerm> terms() const override { return {{"error", error_.number()}}; }
  std::string message(int count, double loss, double) const override {
    char text[120];
    std::snprintf(text, sizeof text, "iteration %d of %d, mean error %.2g of the cube", count,
                  options_.training.iterations, loss);
    return text;
  }

 private:
  const FitOptions& options_;
  Mlp& mlp_;
  const Examples& held_out_;
  Batches batches_;
  Tensor error_;
};

LoopOptions loop_options(const FitOptions& options, const IterationObserver& observer) {
  LoopOptions loop;
  loop.observer = observer;
  loop.training = options.training;
  double& rate = loop.training.learning_rate;
  if (rate == 0.0) rate = FitOptions::automatic_learning_rate(options.training.optimizer);
  loop.optimizer = {.momentum = 0.95, .adam_share = 0.1, .beta1 = 0.9, .beta2 = 0.99};
  loop.schedule = {
      .warm_up = 20, .hold_fraction = 0.0, .final_share = 0.0, .fall = RateSchedule::Fall::linear};
  return loop;
}

}  // namespace

FitResult fit_sdf(PointsIn vertices, TrianglesIn triangles, const FitOptions& options,
                  const Progress& progress, const IterationObserver& observer) {
  const Stopwatch watch;
  options.validate();
  require_memory("near_points", example_bytes * options.points.near_points);
  require_memory("uniform_points", example_bytes * options.points.uniform_points);
  const ThreadScope scope(options.machine.threads);
  const TriangleMesh mesh = facing_outwards({vertices, triangles});
  const Frame frame = mesh_frame(vertices, triangles);
  FitReport report;
  report.device = resolve_device(options.machine.device);
  report.scale = frame.scale;
  Mlp mlp({options.network, 1}, options.training.seed, false, false, report.device);

  progress.report(0.0, "exact distances");
  const SignedDistance distance(vertices, mesh.triangles);
  const auto seed = static_cast<std::uint64_t>(options.training.seed);
  TrainingPointsOptions where = options.points;
  const Examples examples(training_points(distance, mesh, frame, where, seed, progress.part(0.0, 0.08)),
                          mlp.parameters());
  where.near_points = 20000, where.uniform_points = 10000;
  const Examples held_out(
      training_points(distance, mesh, frame, where, seed ^ 0x8e1d0f7u, progress.part(0.08, 0.1)),
      mlp.parameters());
  report.distance_seconds = watch.seconds();

  std::string diverged;
  LoopResult loop;
  try {
    Fit fit(options, mlp, examples, held_out);
    loop = run_training({mlp.parameters(), mlp.gradient(), hidden_matrices(mlp.shape())}, fit,
                        loop_options(options, observer), progress.part(0.1, 1.0));
  } catch (const LoopDiverged& error) {
    diverged = error.what();
    loop = error.result;
  }
  report.stopped_by = loop.stopped_by;
  report.iterations = loop.iterations;
  mlp.release_buffers();

  const Index near = held_out.near_count, rest = held_out.count() - near;
  const Errors close = errors(mlp, held_out.points.narrow(0, 0, near), held_out.distances.narrow(0, 0, near));
  const Errors far =
      errors(mlp, held_out.points.narrow(0, near, rest), held_out.distances.narrow(0, near, rest));
  report.near_mean = close.mean * frame.scale, report.near_max = close.max * frame.scale;
  report.volume_mean = far.mean * frame.scale, report.volume_max = far.max * frame.scale;
  report.seconds = watch.seconds();
  progress.report(1.0, "fitted");
  FitResult result{std::make_shared<NeuralSdf>(std::move(mlp), frame), report};
  if (!diverged.empty()) throw FitDiverged(diverged, result);
  return result;
}

}  // namespace arapfields
