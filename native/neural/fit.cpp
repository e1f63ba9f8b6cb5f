// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/fit.h"

#include <ATen/ATen.h>

#include <chrono>
#include <cmath>
#include <cstdio>

#include "core/device.h"
#include "core/parallel.h"
#include "core/random.h"
#include "distance/training_points.h"
#include "mesh/sample_mesh.h"
#include "neural/muon.h"

namespace arapfields {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Points and distances on the network's device, the near-surface ones first.
struct Examples {
  Examples(const TrainingPoints& given, const at::Tensor& like) : near_count(given.near_surface) {
    points = at::from_blob(const_cast<float*>(given.points.data()), {given.points.rows(), 3}, at::kFloat)
                 .to(like.options(), false, true);
    distances =
        at::from_blob(const_cast<float*>(given.distances.data()), {given.distances.size()}, at::kFloat)
            .to(like.options(), false, true);
  }
  Index count() const { return points.size(0); }

  at::Tensor points, distances;
  Index near_count;
};

/// Random rows of the examples, near_share of them near the surface.
class Batches {
 public:
  Batches(const Examples& examples, const FitOptions& options)
      : examples_(examples),
        near_(std::llround(options.near_share * options.training.batch)),
        random_(options.training.seed, 0xba7c4),
        rows_(at::empty({options.training.batch}, at::kLong)) {}

  void next() {
    Index* rows = rows_.data_ptr<Index>();
    for (Index i = 0; i < rows_.size(0); ++i)
      rows[i] = i < near_ ? random_.below(examples_.near_count)
                          : examples_.near_count + random_.below(examples_.count() - examples_.near_count);
    const at::Tensor where = upload(rows_, examples_.points);
    points = at::index_select(examples_.points, 0, where);
    distances = at::index_select(examples_.distances, 0, where);
  }
  at::Tensor points, distances;

 private:
  const Examples& examples_;
  Index near_;
  Random random_;
  at::Tensor rows_;
};

struct Errors {
  double mean = 0, max = 0;
};

Errors errors(const Mlp& mlp, const at::Tensor& points, const at::Tensor& distances) {
  const at::Tensor off = (mlp.evaluate(points, JetOrder::value).view({-1}) - distances).abs();
  return {off.mean().item<double>(), off.max().item<double>()};
}

/// One fit: what the loop carries from step to step.
class Training {
 public:
  Training(const FitOptions& options, Mlp& mlp, const Examples& examples, const Examples& held_out)
      : options_(options),
        mlp_(mlp),
        held_out_(held_out),
        batches_(examples, options),
        muon_(mlp, {}),
        adam_(mlp.parameters()),
        good_(mlp.parameters().clone()),
        peak_(options.training.learning_rate > 0
                  ? options.training.learning_rate
                  : options.automatic_learning_rate(options.training.optimizer)) {}

  /// Returns what ended it.
  std::string run(const Progress& progress) {
    const Clock::time_point begin = Clock::now();
    const double budget = options_.training.time_budget;
    for (steps = 0; steps < options_.training.iterations; ++steps) {
      const double elapsed = seconds_since(begin);
      if (budget > 0 && elapsed >= budget) return "time_budget";
      const double done = std::max(static_cast<double>(steps) / options_.training.iterations,
                                   budget > 0 ? elapsed / budget : 0.0);
      if (steps % check_every_ == 0) {
        if (!at::isfinite(mlp_.parameters()).all().item<bool>()) return restore();
        good_.copy_(mlp_.parameters());
        good_steps_ = steps;
        report(progress, done);
        if (steps > 0 && options_.target_error > 0 && near_error() <= options_.target_error)
          return "target_error";
      }
      progress.check();
      step(rate(done));
    }
    if (!at::isfinite(mlp_.parameters()).all().item<bool>()) return restore();
    return "iterations";
  }

  int steps = 0;

 private:
  static constexpr int warm_up = 20;

  bool use_adam() const { return options_.training.optimizer == OptimizerKind::adam; }
  double near_error() const {
    const Index some = std::min<Index>(held_out_.near_count, 4096);
    return errors(mlp_, held_out_.points.narrow(0, 0, some), held_out_.distances.narrow(0, 0, some)).mean;
  }
  /// Rises over the first steps, then falls linearly to zero: the last steps average out the batches' noise.
  double rate(double done) const { return peak_ * std::min(1.0, (steps + 1.0) / warm_up) * (1.0 - done); }

  void step(double learning_rate) {
    batches_.next();
    const at::Tensor off = mlp_.forward(batches_.points, JetOrder::value).view({-1}) - batches_.distances;
    loss_ = off;
    mlp_.gradient().zero_();
    mlp_.pull_back(at::sign(off).div_(static_cast<double>(options_.training.batch)).view({1, -1, 1}));
    if (use_adam())
      adam_.step(mlp_.parameters(), mlp_.gradient(), learning_rate);
    else
      muon_.step(mlp_, learning_rate);
  }

  void report(const Progress& progress, double done) {
    char text[120] = "fitting";
    if (loss_.defined())
      std::snprintf(text, sizeof text, "fitting: iteration %d of %d, mean error %.2g of the cube", steps,
                    options_.training.iterations, loss_.abs().mean().item<double>());
    progress.report(done, text);
  }

  std::string restore() {
    mlp_.parameters().copy_(good_);
    steps = good_steps_;
    return "diverged";
  }

  const FitOptions& options_;
  Mlp& mlp_;
  const Examples& held_out_;
  Batches batches_;
  Muon muon_;
  AdamStep adam_;
  at::Tensor good_, loss_;
  int good_steps_ = 0;
  int check_every_ = on_aten_path(mlp_.parameters()) ? 25 : 10;  // a check waits for the device
  double peak_;
};

}  // namespace

FitResult fit_sdf(PointsIn vertices, TrianglesIn triangles, const FitOptions& options,
                  const Progress& progress) {
  const Clock::time_point begin = Clock::now();
  options.validate();
  const ThreadScope scope(options.machine.threads);
  const TriangleMesh mesh{vertices, triangles};
  validate(mesh);
  const Frame frame = mesh_frame(vertices, triangles);
  FitReport report;
  report.device = resolve_device(options.machine.device);
  report.scale = frame.scale;
  Mlp mlp({options.network, 1}, options.training.seed, false, false, report.device);

  progress.report(0.0, "exact distances");
  const SignedDistance distance(vertices, triangles);
  const auto seed = static_cast<std::uint64_t>(options.training.seed);
  TrainingPointsOptions where = options.points;
  const Examples examples(training_points(distance, mesh, frame, where, seed, progress.part(0.0, 0.08)),
                          mlp.parameters());
  where.near_points = 20000, where.uniform_points = 10000;
  const Examples held_out(
      training_points(distance, mesh, frame, where, seed ^ 0x8e1d0f7u, progress.part(0.08, 0.1)),
      mlp.parameters());
  report.distance_seconds = seconds_since(begin);

  Training training(options, mlp, examples, held_out);
  report.stopped_by = training.run(progress.part(0.1, 1.0));
  report.iterations = training.steps;
  mlp.release_buffers();

  const Index near = held_out.near_count, rest = held_out.count() - near;
  const Errors close = errors(mlp, held_out.points.narrow(0, 0, near), held_out.distances.narrow(0, 0, near));
  const Errors far =
      errors(mlp, held_out.points.narrow(0, near, rest), held_out.distances.narrow(0, near, rest));
  report.near_mean = close.mean * frame.scale, report.near_max = close.max * frame.scale;
  report.volume_mean = far.mean * frame.scale, report.volume_max = far.max * frame.scale;
  report.seconds = seconds_since(begin);
  progress.report(1.0, "fitted");
  const std::string stopped_by = report.stopped_by;
  const int steps = report.iterations;
  FitResult result{std::make_shared<NeuralSdf>(std::move(mlp), frame), report};
  if (stopped_by == "diverged")
    throw FitDiverged("fit_sdf left the finite numbers after iteration " + std::to_string(steps) +
                          ", whose state is kept in the error's last_good; a smaller learning_rate may help",
                      result);
  return result;
}

}  // namespace arapfields
