// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/full_solve.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "core/parallel.h"
#include "solve/radial/radial_solver.h"
#include "solve/radial/rest_shape.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Quasi-Newton iterations between two checks of the time budget and of convergence.
constexpr int steps_at_once = 10;
/// A deformation has converged if `steps_at_once` iterations reduce the energy by less than this fraction.
/// Thin parts under many held samples would take hundreds of iterations more for a gain of 1e-4.
constexpr double least_gain = 1e-3;
/// The same for a style, whose edges are still pulled straight for a while: half as many iterations more
/// would gain 0.5 % at most.
constexpr double least_style_gain = 5e-4;
/// In contact it continues while they reduce the penetration depth, or the distance of handles that are held
/// back, to less than these fractions.
constexpr double depth_share = 0.8, distance_share = 0.98;
/// Increases of the energy that do not end it (contact planes that become active raise the energy), and
/// checks at which the depth is above the tolerance without having fallen.
constexpr int most_rises = 6, most_stays = 3;
/// Factor on least_gain while contact holds handles back, which would slide slowly for many iterations.
constexpr double less_where_held = 10.0;
/// A deformation with at least `worth_a_first` centers starts from a solve with half of them, `most_first` at
/// most, of `first_steps` iterations.
constexpr int worth_a_first = 600, most_first = 500, first_steps = 20;
/// Where contact holds handles back, which slide slowly, it continues, at most `most_slides` times, while
/// `solves_a_slide` solves of `steps_a_slide` iterations, which each pull a short way, reduce their distance
/// or the energy to less than the fraction `least_slide`.
constexpr int most_slides = 12, solves_a_slide = 5, steps_a_slide = 4;
constexpr double least_slide = 0.99;
/// Samples of a stylization's energy for each center, and the most.
constexpr int style_samples_a_center = 8, most_style_samples = 8000;
/// Centers, samples and iterations of the coarse solve that a stylization starts from.
constexpr int style_first_centers = 400, style_first_samples = 4000, style_first_steps = 30;
/// A field that folds between the energy samples is solved again, in rounds, with the folded places added and
/// the weight of the fold barrier multiplied by `unfolding`; a deformation's is `least_barrier` at least.
/// Such a one is solved again also where it stretches the mesh more than `most_stretch`, and than the energy
/// samples by the factor `beyond_samples`.
constexpr int unfolding_rounds = 5, unfolding_steps = 15, rounds_anew = 3;
constexpr double unfolding = 3.0, least_barrier = 10.0;
constexpr double most_stretch = 3.0, beyond_samples = 1.5;
/// A solve anew is not kept if the samples' energy is so many times that of before: at places where parts
/// touch and come apart, what the field stretches is no surface.
constexpr double dearer = 3.0;
/// Factor on the weight of exact handles as soft handles of the radial field inside the blend, which no other
/// term holds within their boxes.
constexpr double share_of_exact = 0.01;
/// Fewest surface samples, and energy samples, for each center: with fewer, the field overfits the samples
/// and folds between them.
constexpr int samples_a_center = 8, energy_samples_a_center = 10;
/// Samples of a handle that enter the energy; with fewer, the result depends on which ones are drawn.
constexpr int held_samples = 1024;
/// Exact handles have narrow margins, which need more centers: a factor, and the most.
constexpr double more_for_exact = 4.0 / 3.0;
constexpr int most_for_exact = 2500;
constexpr Index least_centers = 50;

template <class Options>
LiveOptions live_options(const Options& options) {
  LiveOptions live;
  live.surface = options.surface;
  live.handle_samples = std::max(options.handles.handle_batch, held_samples);
  live.threads = options.machine.threads;
  live.seed = options.training.seed;
  live.tolerance = 3e-5;
  return live;
}

/// Sets the number of fine centers, limited by that of the samples, and a fifth as many coarse ones.
void set_centers(LiveOptions& live, int centers, const SurfaceSamples& samples) {
  const Index carried = std::max(least_centers, samples.size() / samples_a_center);
  live.fine_centers = static_cast<int>(std::min<Index>(centers, carried));
  live.coarse_centers = live.fine_centers / 5;
  live.samples = std::max(live.samples, energy_samples_a_center * live.fine_centers);
}

/// Makes the field of the current state.
using Shown = std::function<std::shared_ptr<DeformationField>()>;

/// Bounds on the solver's energy.
struct Bounds {
  double worst = std::numeric_limits<double>::infinity();  ///< states of higher energy are not previewed
  double least_gain = 0.0;  ///< least relative decrease in `steps_at_once` iterations
};

/// Sum of the distances of handles that are held back.
double distance_held(const ContactReport& contact) {
  double sum = 0.0;
  for (const HeldBack& handle : contact.held) sum += handle.distance;
  return sum;
}

/// Continues a coarse solve in which contact holds handles back.
void slide(RadialSolver& coarse, int iterations, const Progress& progress) {
  double held = distance_held(coarse.report().contact);
  double value = std::numeric_limits<double>::infinity();
  for (int times = 0; held > 0.0 && times < most_slides; ++times) {
    const double done = static_cast<double>(times) / most_slides;
    for (int solve = 0; solve < solves_a_slide; ++solve)
      coarse.solve(std::min(steps_a_slide, iterations), 0.0, progress.part(done, done));
    const double before = std::exchange(held, distance_held(coarse.report().contact));
    const double higher = std::exchange(value, coarse.report().value);
    if (held >= least_slide * before && value >= least_slide * higher) break;
  }
}

/// Decides after each `steps_at_once` iterations whether more of them are worth it.
class Convergence {
 public:
  Convergence(double least, bool contact) : least_gain_(least), contact_(contact) {}
  bool continues(const RadialReport& report, int iterations) {
    const ContactReport& contact = report.contact;
    const double held = distance_held(contact);
    const double gain = value_ - report.value;
    const double least = (contact.held.empty() ? 1.0 : less_where_held) * least_gain_ * report.value;
    const bool gains = report.iterations >= iterations && gain >= least;
    const bool slides = held < distance_share * held_;
    const bool rises = contact_ && gain <= -least && rises_++ < most_rises;
    const bool comes_out = contact.deepest < depth_share * deepest_;
    value_ = report.value;
    deepest_ = contact.deepest;
    held_ = held;
    return gains || slides || rises || (contact.unsettled && (comes_out || stays_++ < most_stays));
  }

 private:
  double least_gain_;
  bool contact_;
  double value_ = std::numeric_limits<double>::infinity();
  double deepest_ = value_;
  double held_ = 0.0;  // sum of the distances of handles that are held back
  int rises_ = 0;
  int stays_ = 0;
};

/// Solves until convergence, until the iterations or the time budget run out, or until the observer ends it.
/// The solver's energy is the loss divided by `rigidity`.
LoopResult run(RadialSolver& live, const TrainingOptions& how, const Progress& progress,
               const SolveHooks& hooks, double rigidity, const Shown& shown, const Bounds& bounds) {
  const int iterations = how.iterations;
  const Stopwatch watch;
  LoopResult result;
  Iteration iteration;
  bool ended = false;
  Convergence convergence(bounds.least_gain, hooks.contact.has_value());
  RadialHooks steps{hooks.energies, 1.0 / rigidity, {}, hooks.terms};
  if (hooks.observer)
    steps.observer = [&](const std::vector<LossTerm>& terms) {
      ++iteration.number;
      iteration.loss = 0.0;
      iteration.terms = terms;
      for (LossTerm& term : iteration.terms) iteration.loss += term.value *= rigidity;
      iteration.seconds = watch.seconds();
      ended = !hooks.observer(iteration);
      return !ended;
    };
  live.set_hooks(steps);
  while (result.iterations < iterations) {
    const int at_once = std::min(steps_at_once, iterations - result.iterations);
    const double done = static_cast<double>(result.iterations) / iterations;
    live.solve(at_once, 0.0, progress.part(done, done + static_cast<double>(at_once) / iterations));
    const double value = live.report().value;
    if (value <= bounds.worst) progress.preview([&](PointsIn points) { return shown()->at(points); });
    result.iterations += static_cast<int>(live.report().iterations);
    result.history.emplace_back(result.iterations, value);
    result.seconds = watch.seconds();
    if (ended) {
      result.stopped_by = StopReason::observer;
      break;
    }
    if (!convergence.continues(live.report(), at_once)) break;
    if (how.time_budget > 0.0 && result.seconds > how.time_budget) {
      result.stopped_by = StopReason::time_budget;
      break;
    }
  }
  return result;
}

bool was_ended(const LoopResult& loop) {
  return loop.stopped_by == StopReason::observer || loop.stopped_by == StopReason::time_budget;
}

/// How a solve goes on where the field folds or stretches between the energy samples.
struct Unfolding {
  double barrier = 0.0;  ///< weight of the fold barrier
  int rounds = 0, steps = 0;
  bool all_samples = false;  ///< look at all samples; else only where the mesh or the energy samples fold
  bool stretches = false;    ///< whether stretches count
  /// Solves anew in `rounds_anew`, without a barrier, and returns whether that is to be kept; empty: goes on
  /// from the present shape. Where nothing held the field it may be so far off that descent from there is
  /// slow, and behind the barrier stuck.
  std::function<bool()> anew = {};
};

/// Whether a field folds fewer triangles of the samples' mesh than another, or stretches as many less.
bool is_better(const DeformationField& before, const DeformationField& now, const SurfaceSamples& samples) {
  if (!samples.mesh) return true;
  const MeshMeasures was = measure_triangles(before, *samples.mesh);
  const MeshMeasures is = measure_triangles(now, *samples.mesh);
  return is.folded < was.folded ||
         (is.folded == was.folded && is.distortion.max_stretch < was.distortion.max_stretch / beyond_samples);
}

/// Solves in rounds while the field folds or stretches at samples or triangles. Returns the measures of the
/// samples' mesh in the end.
std::optional<MeshMeasures> unfold(RadialSolver& solver, const SurfaceSamples& samples,
                                   const SurfaceOptions& surface, const Unfolding& how, const Shown& shown,
                                   const Progress& progress) {
  DistortionLimits limits{surface.barrier_threshold};
  if (how.stretches)
    limits.most_stretch = std::max(most_stretch, beyond_samples * solver.report().distortion.max_stretch);
  std::optional<MeshMeasures> seen;
  int rounds = how.rounds;
  for (int round = 0;; ++round) {
    const std::shared_ptr<const DeformationField> now = shown();
    if (samples.mesh) seen = measure_triangles(*now, *samples.mesh, limits);
    const bool is_wrong = seen && seen->is_wrong;
    if (round == rounds || !(how.all_samples || is_wrong || solver.report().distortion.flipped_share > 0.0))
      break;
    const bool is_anew = round < rounds_anew && how.anew;
    const MeshPlaces places = is_wrong ? seen->wrong : MeshPlaces();
    if (solver.add_fold_samples(is_anew ? surface.barrier : how.barrier, *now, places) == 0) break;
    if (!is_anew)
      solver.solve(how.steps, 0.0, progress);
    else if (!how.anew())
      rounds = round + 1;
  }
  return seen;
}

Solution finish(const Shown& shown, const SurfaceSamples& samples, const ObjectiveTerms& terms,
                LoopResult loop, std::optional<MeshMeasures> of_mesh, const RadialReport& solved,
                const Progress& progress) {
  progress.report(0.98, "measuring the result");
  Solution solution = measured(shown(), samples, terms, std::move(loop), std::move(of_mesh));
  solution.report.contact = solved.contact;
  solution.report.terms = solved.terms;
  for (LossTerm& term : solution.report.terms) term.value *= terms.rigidity;
  for (std::string& note : notes_on(solved.contact)) solution.report.warnings.push_back(std::move(note));
  return solution;
}

}  // namespace

Solution deform_radial(const SurfaceSamples& given, const std::vector<Handle>& handles,
                       const DeformOptions& options, const Progress& progress, const SolveHooks& hooks,
                       const ExactHandles* exact) {
  const int axis = axis_of(options.symmetry);
  const SurfaceSamples samples = axis < 0 ? given : across(given, axis);
  require(options.handles.handle_weight > 0.0, "handle_weight", "0", "must be positive for 'radial'");
  const ThreadScope threads(options.machine.threads);
  LiveOptions fine = live_options(options);
  fine.locality = options.locality;
  fine.symmetry = options.symmetry;
  const int more = std::min(most_for_exact, static_cast<int>(more_for_exact * options.centers));
  set_centers(fine, exact != nullptr ? std::max(options.centers, more) : options.centers, samples);
  fine.handle_weight = options.handles.handle_weight * (exact != nullptr ? share_of_exact : 1.0);
  const auto blend = exact != nullptr ? exact->blend : nullptr;
  const auto around = [&](std::shared_ptr<DeformationField> field) {
    return exact != nullptr ? exact->around(std::move(field)) : field;
  };
  const auto shape = std::make_shared<const RestShape>(
      samples, fine.interior, static_cast<std::uint64_t>(options.training.seed), progress, axis);
  std::shared_ptr<RadialField> first;
  ContactReport contact_first;
  if (exact != nullptr || fine.fine_centers >= worth_a_first) {
    LiveOptions few = live_options(options);
    few.symmetry = options.symmetry;
    few.locality = options.locality;
    set_centers(few, std::min(most_first, fine.fine_centers / 2), samples);
    few.handle_weight = (exact != nullptr ? followed_closely(options) : options).handles.handle_weight;
    few.tolerance = LiveOptions().tolerance;
    RadialSolver solver(samples, handles, few, progress.part(0.0, 0.1), shape);
    solver.set_contact(hooks.contact, true, progress);
    solver.solve(std::min(first_steps, options.training.iterations), 0.0, progress.part(0.1, 0.13));
    slide(solver, options.training.iterations, progress.part(0.13, 0.15));
    contact_first = solver.report().contact;
    first = solver.field();
    progress.preview([&](PointsIn points) { return around(first)->at(points); });
  }
  const double done = first ? 0.15 : 0.0;
  RadialSolver solver(samples, handles, fine, progress.part(done, 0.4), shape, blend);
  solver.set_contact(hooks.contact, true, progress);
  if (first) solver.adopt(*first, contact_first);
  std::shared_ptr<DeformationField> kept;  // of before a solve that was not worth it
  const Shown shown = [&] { return kept ? kept : around(solver.field()); };
  LoopResult loop =
      run(solver, options.training, progress.part(0.4, 0.95), hooks, 1.0, shown, {.least_gain = least_gain});
  ObjectiveTerms terms;
  terms.stiffness = SurfaceStiffness(shape->thickness, options.surface);
  terms.handles = BoundHandles(in_cube(handles, samples.frame), samples.points);
  terms.weights = energy_weights(samples, terms.handles);
  SolveHooks unseen = hooks;
  unseen.observer = nullptr;
  solver.set_hooks({hooks.energies, 1.0, {}, hooks.terms});
  Unfolding how{unfolding * std::max(options.surface.barrier, least_barrier)};
  how.rounds = was_ended(loop) || hooks.contact ? 0 : unfolding_rounds;
  how.steps = std::min(unfolding_steps, options.training.iterations);
  how.stretches = true;
  RadialReport solved;  // of `kept`
  how.anew = [&] {
    solved = solver.report();
    const std::shared_ptr<DeformationField> before = shown();
    const double energy = measure(*before, samples, terms).arap.energy;
    solver.reset();
    solver.set_targets(handles);
    if (first) solver.adopt(*first);
    const LoopResult again = run(solver, options.training, progress.part(0.95, 0.97), unseen, 1.0, shown,
                                 {.least_gain = least_gain});
    for (const auto& [iterations, value] : again.history)
      loop.history.emplace_back(loop.iterations + iterations, value);
    loop.iterations += again.iterations;
    loop.seconds += again.seconds;
    if (is_better(*before, *shown(), samples) &&
        measure(*shown(), samples, terms).arap.energy <= dearer * energy)
      return true;
    kept = before;
    return false;
  };
  std::optional<MeshMeasures> of_mesh =
      unfold(solver, samples, options.surface, how, shown, progress.part(0.97, 0.98));
  return finish(shown, samples, terms, std::move(loop), std::move(of_mesh), kept ? solved : solver.report(),
                progress);
}

DeformOptions followed_closely(DeformOptions options) {
  constexpr double closer = 100.0, heaviest = 1e9;
  options.exact_handles = false;
  options.handles.handle_weight = std::min(closer * options.handles.handle_weight, heaviest);
  return options;
}

std::shared_ptr<const DeformationField> radial_start(const SurfaceSamples& samples,
                                                     const std::vector<Handle>& handles,
                                                     DeformOptions options, const Progress& progress) {
  constexpr int start_steps = 30;
  if (options.exact_handles) options = followed_closely(options);
  options.invertibility = 0.0;
  options.training.iterations = start_steps;
  return deform_radial(samples, handles, options, progress).field;
}

Solution stylize_radial(const SurfaceSamples& samples, const Style& style, const StylizeOptions& options,
                        const Progress& progress, const Vector& weights, const std::vector<Handle>& handles,
                        const Vec3& up, const SolveHooks& hooks) {
  // The solver's rigidity has weight 1: all other weights are divided by options.rigidity.
  LiveOptions live = live_options(options);
  live.locality.locality = 0.0;
  live.samples = std::min(most_style_samples, style_samples_a_center * options.centers);
  live.coarse_centers = 2 * options.centers / 13;
  live.fine_centers = options.centers;
  live.fine_radius_factor = 3.0;
  live.tolerance = 1e-4;
  live.handle_weight = std::max(options.handles.handle_weight, 1e-3) / options.rigidity;
  live.surface.barrier = options.surface.barrier / options.rigidity;
  live.gauss_weight = options.gauss_weight / options.rigidity;
  live.keep_stance = options.keep_stance / options.rigidity;
  live.interior = !handles.empty();  // a style alone acts everywhere alike
  const auto shape = std::make_shared<const RestShape>(
      samples, live.interior, static_cast<std::uint64_t>(options.training.seed), progress);
  double worst = std::numeric_limits<double>::infinity();
  if (options.centers >= worth_a_first) {
    LiveOptions few = live;
    few.samples = style_first_samples;
    few.fine_centers = style_first_centers;
    few.coarse_centers = few.fine_centers / 5;
    RadialSolver quick(samples, handles, few, progress.part(0.0, 0.1), shape);
    quick.set_contact(hooks.contact, true, progress);
    quick.set_style(style, options.strength, options.sharpness, weights, up);
    const std::shared_ptr<const RadialField> first =
        quick.solve(std::min(style_first_steps, options.training.iterations), 0.0, progress.part(0.1, 0.15));
    progress.preview([&](PointsIn points) { return first->at(points); });
    worst = quick.report().value;
  }
  RadialSolver solver(samples, handles, live, progress.part(0.15, 0.3), shape);
  solver.set_contact(hooks.contact, true, progress);
  solver.set_style(style, options.strength, options.sharpness, weights, up);
  const Shown shown = [&] { return solver.field(); };
  const LoopResult loop = run(solver, options.training, progress.part(0.3, 0.95), hooks, options.rigidity,
                              shown, {.worst = worst, .least_gain = least_style_gain});
  solver.set_hooks({hooks.energies, 1.0 / options.rigidity, {}, hooks.terms});
  Unfolding how{unfolding * live.surface.barrier};
  how.rounds = options.surface.barrier > 0.0 && !was_ended(loop) ? unfolding_rounds : 0;
  how.steps = std::min(unfolding_steps, options.training.iterations);
  how.all_samples = true;
  std::optional<MeshMeasures> of_mesh =
      unfold(solver, samples, options.surface, how, shown, progress.part(0.95, 0.98));
  ObjectiveTerms terms;
  terms.rigidity = options.rigidity;
  terms.stiffness = SurfaceStiffness(shape->thickness, options.surface);
  terms.style = StyleAtSamples::of(style, samples.normals, options.sharpness);
  terms.handles = BoundHandles(in_cube(handles, samples.frame), samples.points);
  terms.weights = energy_weights(samples, terms.handles);
  return finish(shown, samples, terms, loop, std::move(of_mesh), solver.report(), progress);
}

}  // namespace arapfields
