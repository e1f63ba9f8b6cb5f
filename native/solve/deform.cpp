// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/deform.h"

#include "core/parallel.h"
#include "fields/neural_field.h"
#include "solve/inverse_training.h"
#include "solve/live_solver.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

std::shared_ptr<const HandleBlend> exact_blend(const BoundHandles& handles, double margin,
                                               std::vector<std::string>& notes) {
  std::vector<RigidRegion> regions;
  std::vector<Points> members;
  for (Index i = 0; i < handles.count(); ++i) {
    const Handle& handle = handles.handle(i);
    const std::string name = "handles[" + std::to_string(i) + "]";
    require(handle.kind != Handle::Kind::region, name, "a region of listed samples",
            "exact handles are cuboids or points");
    RigidRegion region{handle.rest, handles.motion(i), margin, name};
    if (handle.kind == Handle::Kind::point) {
      region.placement = Mat4::Zero();
      region.placement.topRightCorner<3, 1>() = handle.rest_point;
    }
    regions.push_back(region);
    members.push_back(
        handles.sources().middleRows(handles.begin(i), handles.begin(i + 1) - handles.begin(i)));
  }
  notes = limit_margins(regions, members);
  return std::make_shared<HandleBlend>(std::move(regions));
}

ObjectiveTerms terms_of(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                        const DeformOptions& options) {
  ObjectiveTerms terms;
  terms.batch = options.batch;
  terms.bending = options.bending;
  terms.barrier = options.barrier;
  terms.barrier_threshold = options.barrier_threshold;
  terms.handles = BoundHandles(in_cube(handles, samples.frame), samples.points);
  terms.handle_weight = options.exact_handles ? 0.0 : options.handle_weight;
  terms.handle_batch = options.handle_batch;
  return terms;
}

LiveOptions live_options(const DeformOptions& options) {
  LiveOptions live;
  live.coarse_bumps = options.bumps / 5;
  live.fine_bumps = options.bumps;
  live.samples = std::max(live.samples, 4 * options.bumps);
  live.bending = options.bending;
  live.handle_weight = options.handle_weight;
  live.threads = options.threads;
  live.seed = options.seed;
  return live;
}

/// Quasi-Newton steps until they gain nothing, or until `steps` or the time budget is spent.
Solution solve_radial(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                      const ObjectiveTerms& terms, const DeformOptions& options, int steps,
                      const Progress& progress) {
  constexpr int stride = 4;
  const Stopwatch watch;
  LiveSolver live(samples, handles, live_options(options), progress.part(0.0, 0.4));
  std::shared_ptr<RadialField> field = live.field();
  LoopResult loop;
  while (loop.iterations < steps) {
    loop.out_of_time = options.time_budget > 0.0 && watch.seconds() >= options.time_budget;
    if (loop.out_of_time) break;
    field = live.solve(std::min(stride, steps - loop.iterations), 1e-6, progress.part(0.4, 0.9));
    loop.iterations += static_cast<int>(live.report().steps);
    loop.history.emplace_back(loop.iterations, live.report().value);
    if (live.report().converged || live.report().steps == 0) break;
  }
  loop.seconds = watch.seconds();
  return measured(field, samples, terms, loop);
}

}  // namespace

Solution deform(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                const DeformOptions& options, const Progress& progress) {
  constexpr int start_steps = 20;
  options.validate();
  require_samples(samples);
  require(!handles.empty(), "handles", "none were given", "at least one is needed");
  const ThreadScope threads(options.threads);
  ObjectiveTerms terms = terms_of(samples, handles, options);
  if (options.field == "radial")
    return solve_radial(samples, handles, terms, options, options.iterations, progress);

  const MlpShape shape{
      3, options.width, options.layers, options.octaves, options.frequency, options.sharpness};
  const auto seed = static_cast<std::uint64_t>(options.seed);
  auto field = std::make_shared<NeuralField>(shape, seed, false, resolve_device(options.device));
  std::vector<std::string> notes;
  if (options.exact_handles) field->set_handles(exact_blend(terms.handles, options.margin, notes));
  const double share = options.start == "radial" ? 0.1 : 0.0;
  if (options.start == "radial")
    field->set_base(
        solve_radial(samples, handles, terms, options, start_steps, progress.part(0.0, share)).field);

  LoopOptions loop;
  loop.stage = "deform";
  loop.iterations = options.iterations;
  loop.optimizer = options.optimizer;
  loop.learning_rate = options.learning_rate;
  loop.time_budget = options.time_budget;
  loop.seed = seed;
  WrapObjective wrap;
  if (options.invertibility > 0.0)
    wrap = [&](Objective& inner) {
      return std::make_unique<InvertibleObjective>(inner, samples, options.batch, options.invertibility,
                                                   shape, loop, resolve_device(options.device));
    };
  Solution solution = solve_field(field, samples, std::move(terms), loop, progress.part(share, 1.0), wrap);
  solution.report.notes = notes;
  return solution;
}

}  // namespace arapfields
