// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial.h"

#include <algorithm>
#include <cmath>

#include "solve/live_solver.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Steps between two looks at the clock.
constexpr int steps_at_once = 10;
/// From so many centers on, few centers make a first result, in so many steps at most.
constexpr int worth_a_first = 600, first_steps = 12;
constexpr int samples_a_center = 8;

template <class Options>
LiveOptions live_options(const Options& options) {
  LiveOptions live;
  live.surface = options.surface;
  live.handle_samples = options.handles.handle_batch;
  live.threads = options.machine.threads;
  live.seed = options.training.seed;
  live.tolerance = 1e-5;
  return live;
}

/// Solves until it converges, is out of steps, or out of time.
LoopResult run(LiveSolver& live, const TrainingOptions& how, const Progress& progress) {
  const int iterations = how.iterations;
  const Stopwatch watch;
  LoopResult result;
  while (result.iterations < iterations) {
    const int steps = std::min(steps_at_once, iterations - result.iterations);
    const double done = static_cast<double>(result.iterations) / iterations;
    live.solve(steps, 0.0, progress.part(done, done + static_cast<double>(steps) / iterations));
    progress.look([&](PointsIn points) { return live.field()->at(points); });
    result.iterations += static_cast<int>(live.report().iterations);
    result.history.emplace_back(result.iterations, live.report().value);
    result.seconds = watch.seconds();
    if (live.report().iterations < steps) break;
    if (how.time_budget > 0.0 && result.seconds > how.time_budget) {
      result.stopped_by = StopReason::time_budget;
      break;
    }
  }
  return result;
}

Solution finish(const LiveSolver& live, const SurfaceSamples& samples, const ObjectiveTerms& terms,
                LoopResult loop, const Progress& progress) {
  progress.report(0.98, "measuring the result");
  return measured(live.field(), samples, terms, std::move(loop));
}

}  // namespace

Solution deform_radial(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                       const DeformOptions& options, const Progress& progress) {
  require(options.handles.handle_weight > 0.0, "handle_weight", "0", "must be positive for 'radial'");
  LiveOptions fine = live_options(options);
  fine.samples = std::max(fine.samples, samples_a_center * options.centers);
  fine.coarse_centers = options.centers / 5;
  fine.fine_centers = options.centers;
  fine.handle_weight = options.handles.handle_weight;
  std::shared_ptr<RadialField> first;
  if (options.centers >= worth_a_first) {
    LiveOptions few = live_options(options);
    few.handle_weight = fine.handle_weight;
    few.tolerance = LiveOptions().tolerance;
    LiveSolver solver(samples, handles, few, progress.part(0.0, 0.1));
    first = solver.solve(std::min(first_steps, options.training.iterations), 0.0, progress.part(0.1, 0.15));
    progress.look([&](PointsIn points) { return first->at(points); });
  }
  const double done = first ? 0.15 : 0.0;
  LiveSolver solver(samples, handles, fine, progress.part(done, 0.4));
  if (first) solver.adopt(*first);
  const LoopResult loop = run(solver, options.training, progress.part(0.4, 0.95));
  ObjectiveTerms terms;
  terms.stiffness = SurfaceStiffness(samples, options.surface);
  terms.handles = BoundHandles(in_cube(handles, samples.frame), samples.points);
  return finish(solver, samples, terms, loop, progress);
}

std::shared_ptr<const DeformationField> radial_start(const SurfaceSamples& samples,
                                                     const std::vector<Handle>& handles,
                                                     DeformOptions options, const Progress& progress) {
  constexpr int start_steps = 30;
  constexpr double closer = 100.0, heaviest = 1e9;  // under exact handles, which the blend then hardly bends
  if (options.exact_handles)
    options.handles.handle_weight = std::min(closer * options.handles.handle_weight, heaviest);
  options.exact_handles = false;
  options.invertibility = 0.0;
  options.training.iterations = start_steps;
  return deform_radial(samples, handles, options, progress).field;
}

Solution stylize_radial(const SurfaceSamples& samples, PointsIn preferred, const StylizeOptions& options,
                        const Progress& progress, const Vector& weights, const std::vector<Handle>& handles,
                        const Vec3& up) {
  // The live solver's energy has weight 1: all other weights are divided by this one's.
  LiveOptions live = live_options(options);
  live.samples = 6000;
  live.coarse_centers = 200;
  live.fine_centers = 1000;
  live.tolerance = 1e-4;
  live.handle_weight = std::max(options.handles.handle_weight, 1e-3) / options.rigidity;
  live.surface.barrier = options.surface.barrier / options.rigidity;
  live.gauss_weight = options.gauss_weight / options.rigidity;
  live.keep_stance = options.keep_stance / options.rigidity;
  live.interior = !handles.empty();  // a style alone acts everywhere alike: nothing is to be held apart
  LiveSolver solver(samples, handles, live, progress.part(0.0, 0.3));
  solver.set_style(preferred, options.strength, options.sharpness, weights, up);
  const LoopResult loop = run(solver, options.training, progress.part(0.3, 0.95));
  ObjectiveTerms terms;
  terms.rigidity = options.rigidity;
  terms.stiffness = SurfaceStiffness(samples, options.surface);
  terms.preference = gauss_preference(preferred, options.sharpness);
  terms.handles = BoundHandles(in_cube(handles, samples.frame), samples.points);
  return finish(solver, samples, terms, loop, progress);
}

}  // namespace arapfields
