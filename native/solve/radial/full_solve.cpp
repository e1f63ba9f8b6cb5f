// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/full_solve.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "core/parallel.h"
#include "solve/contact/parameters.h"
#include "solve/radial/radial_solver.h"
#include "solve/radial/rest_shape.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// The constants of a whole solve, with their reasons.
struct FullSolve {
  /// Iterations between two checks of the time budget and of convergence: often enough for a budget.
  static constexpr int check_iterations = 10;
  /// A deformation has converged if a check's iterations reduce the energy by less than this fraction: thin
  /// parts under many held samples would take hundreds of iterations more for a gain of 1e-4.
  static constexpr double least_gain = 1e-3;
  /// The same for a style, whose edges are still pulled straight for a while: half as many iterations more
  /// would gain 0.5 % at most.
  static constexpr double least_style_gain = 5e-4;
  /// Relative tolerances of the solver: of a deformation, near single precision's; of a style, whose energy
  /// is larger.
  static constexpr double tolerance = 3e-5, style_tolerance = 1e-4;

  /// Fewest surface samples, and energy samples, for each center: with fewer, the field overfits the samples
  /// and folds between them.
  static constexpr int samples_a_center = 8, energy_samples_a_center = 10;
  /// Samples of a handle that enter the energy; with fewer, the result depends on which ones are drawn.
  static constexpr int held_samples = 1024;
  /// Fewest centers, of surfaces with few samples: fewer do not bend between two handles.
  static constexpr Index least_centers = 50;
  /// Coarse centers, wide ones, as a fraction of all: they carry the large motions.
  static constexpr int centers_a_coarse = 5;
  /// Exact handles have narrow margins, which need more centers: a factor, and the most.
  static constexpr double more_for_exact = 4.0 / 3.0;
  static constexpr int most_for_exact = 2500;
  /// Factor on the weight of exact handles as soft handles of the radial field inside the blend, which no
  /// other term holds within their boxes.
  static constexpr double share_of_exact = 0.01;
  /// Factor on the weight of handles that a blend with exact ones hardly bends, and their heaviest weight:
  /// double precision ends above.
  static constexpr double closer = 100.0, heaviest = 1e9;

  /// A solve with at least so many centers starts from a coarse one, which costs a tenth.
  static constexpr int min_centers_for_coarse_start = 600;
  /// A deformation's coarse start: half of the centers, so many at most, and its iterations.
  static constexpr int most_first = 500, first_iterations = 20;
  /// A style's coarse start: centers, samples and iterations.
  static constexpr int style_first_centers = 400, style_first_samples = 4000, style_first_iterations = 30;
  /// Iterations of a network's start, which trains on.
  static constexpr int start_iterations = 30;

  /// Samples of a style's energy for each center, and the most: it is smoother than a deformation's.
  static constexpr int style_samples_a_center = 8, most_style_samples = 8000;
  /// A style's centers for each two coarse ones: styles move a surface little.
  static constexpr int style_centers_a_coarse_pair = 13;
  /// Radius of a style's fine Gaussians in their spacings: wide enough to be smooth between centers.
  static constexpr double style_radius = 3.0;
  /// Least weight of handles in a style: one of none would leave the shape free.
  static constexpr double least_handle_weight = 1e-3;
  /// A field that folds between the energy samples is solved again, in rounds of so many iterations, with the
  /// folded places added and the weight of the fold barrier multiplied by a factor; a deformation's is the
  /// least one at least, and its first rounds start anew.
  static constexpr int unfolding_rounds = 5, unfolding_iterations = 15, rounds_anew = 3;
  static constexpr double unfolding = 3.0, least_barrier = 10.0;
  /// A deformation goes on also where it stretches the mesh more than the first, and than the energy samples
  /// by the second factor: these are not seen there.
  static constexpr double most_stretch = 3.0, beyond_samples = 1.5;
  /// A round is not kept if the samples' energy is so many times that of before: at places where parts touch
  /// and come apart, what the field stretches is no surface.
  static constexpr double dearer = 3.0;
};

template <class Options>
LiveOptions live_options(const Options& options) {
  LiveOptions live;
  live.surface = options.surface;
  live.handle_samples = std::max(options.handles.handle_batch, FullSolve::held_samples);
  live.threads = options.machine.threads;
  live.seed = options.training.seed;
  live.tolerance = FullSolve::tolerance;
  return live;
}

/// Sets the number of fine centers, limited by that of the samples, and a fifth as many coarse ones.
void set_centers(LiveOptions& live, int centers, const SurfaceSamples& samples) {
  const Index carried = std::max(FullSolve::least_centers, samples.size() / FullSolve::samples_a_center);
  live.fine_centers = static_cast<int>(std::min<Index>(centers, carried));
  live.coarse_centers = live.fine_centers / FullSolve::centers_a_coarse;
  live.samples = std::max(live.samples, FullSolve::energy_samples_a_center * live.fine_centers);
}

/// Makes the field of the current state.
using Shown = std::function<std::shared_ptr<DeformationField>()>;

/// Bounds on the solver's energy.
struct Bounds {
  double worst = std::numeric_limits<double>::infinity();  ///< states of higher energy are not previewed
  double least_gain = 0.0;  ///< least relative decrease in the iterations of a check
  double share = 1.0;       ///< of the way from rest that previews go
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
  for (int times = 0; held > 0.0 && times < P::most_slides; ++times) {
    const double done = static_cast<double>(times) / P::most_slides;
    for (int solve = 0; solve < P::solves_a_slide; ++solve)
      coarse.solve(std::min(P::iterations_a_slide, iterations), 0.0, progress.part(done, done));
    const double before = std::exchange(held, distance_held(coarse.report().contact));
    const double higher = std::exchange(value, coarse.report().value);
    if (held >= P::slide_gain * before && value >= P::slide_gain * higher) break;
  }
}

/// Decides at each check whether more of them are worth it.
class Convergence {
 public:
  Convergence(double least, bool contact) : least_gain_(least), contact_(contact) {}
  bool continues(const RadialReport& report, int iterations) {
    const ContactReport& contact = report.contact;
    const double held = distance_held(contact);
    const double gain = value_ - report.value;
    const double least = (contact.held.empty() ? 1.0 : P::gain_while_held) * least_gain_ * report.value;
    const bool gains = report.iterations >= iterations && gain >= least;
    const bool slides = held < P::distance_gain * held_;
    const bool rises = contact_ && gain <= -least && rises_++ < P::most_rises;
    const bool comes_out = contact.deepest < P::depth_gain * deepest_;
    value_ = report.value;
    deepest_ = contact.deepest;
    held_ = held;
    return gains || slides || rises ||
           (contact.unsettled && (comes_out || stalled_checks_++ < P::most_stalled_checks));
  }

 private:
  double least_gain_;
  bool contact_;
  double value_ = std::numeric_limits<double>::infinity();
  double deepest_ = value_;
  double held_ = 0.0;  // sum of the distances of handles that are held back
  int rises_ = 0;
  int stalled_checks_ = 0;
};

/// Previews this share of the way from rest.
void preview(const Progress& progress, const Shown& shown, double share) {
  progress.preview([&](PointsIn points) -> Points {
    const Points moved = shown()->at(points);
    return share == 1.0 ? moved : points + share * (moved - points);
  });
}

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
    const int at_once = std::min(FullSolve::check_iterations, iterations - result.iterations);
    const double done = static_cast<double>(result.iterations) / iterations;
    live.solve(at_once, 0.0, progress.part(done, done + static_cast<double>(at_once) / iterations));
    const double value = live.report().value;
    if (value <= bounds.worst) preview(progress, shown, bounds.share);
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

/// The terms that a report measures.
ObjectiveTerms measured_terms(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                              const RestShape& shape, const SurfaceOptions& surface) {
  ObjectiveTerms terms;
  terms.stiffness = SurfaceStiffness(shape.thickness, surface);
  terms.handles = bound_handles(handles, samples);
  terms.weights = energy_weights(samples, terms.handles);
  return terms;
}

bool was_ended(const LoopResult& loop) {
  return loop.stopped_by == StopReason::observer || loop.stopped_by == StopReason::time_budget;
}

/// How a solve goes on where the field folds or stretches between the energy samples.
struct Unfolding {
  double barrier = 0.0;  ///< weight of the fold barrier
  int rounds = 0, steps = 0;
  bool all_samples = false;  ///< look at all samples; else only where the mesh or the energy samples fold
  bool of_mesh = false;  ///< folds and stretches of the mesh's own triangles count; a style's are mended by
                         ///< its finish
  /// Solves anew in `rounds_anew`, without a barrier; empty: goes on from the present shape. Where nothing
  /// held the field it may be so far off that descent from there is slow, and behind the barrier stuck.
  std::function<void()> anew = {};
};

/// A field of a solve, and what was measured of it.
struct Candidate {
  std::shared_ptr<DeformationField> field;
  RadialReport solved;
  Measures measures;
};

/// Whether a field folds fewer triangles than another, then fewer samples, or as many and stretches them
/// less, and is not much dearer.
bool is_better(const Measures& now, const Measures& before) {
  const auto folds = [](const Measures& of) {
    return std::pair(of.of_mesh ? of.of_mesh->folded : 0, of.at_samples->distortion.flipped_share);
  };
  const auto stretch = [](const Measures& of) {
    return (of.of_mesh ? of.of_mesh->distortion : of.at_samples->distortion).max_stretch;
  };
  return now.at_samples->arap.energy <= FullSolve::dearer * before.at_samples->arap.energy &&
         (folds(now) < folds(before) ||
          (folds(now) == folds(before) && stretch(now) < stretch(before) / FullSolve::beyond_samples));
}

/// Solves in rounds while the field folds or stretches at samples or triangles, or until a round is no better
/// than the one before. Returns the best.
Candidate unfold(RadialSolver& solver, const SurfaceSamples& samples, const SurfaceOptions& surface,
                 const ObjectiveTerms& terms, const Unfolding& how, const Shown& shown,
                 const Progress& progress) {
  DistortionLimits limits{surface.barrier_threshold};
  if (how.of_mesh)
    limits.most_stretch =
        std::max(FullSolve::most_stretch, FullSolve::beyond_samples * solver.report().distortion.max_stretch);
  const auto present = [&] {
    Candidate result{shown(), solver.report(), {}};
    if (how.of_mesh) result.measures.at_samples = measure(*result.field, samples, terms);
    if (samples.mesh) result.measures.of_mesh = measure_triangles(*result.field, *samples.mesh, limits);
    return result;
  };
  Candidate best = present();
  for (int round = 0; round < how.rounds; ++round) {
    const std::optional<MeshMeasures>& of_mesh = best.measures.of_mesh;
    const bool is_wrong = how.of_mesh && of_mesh && of_mesh->is_wrong;
    if (!(how.all_samples || is_wrong || best.solved.distortion.flipped_share > 0.0)) break;
    const bool is_anew = round < FullSolve::rounds_anew && how.anew;
    const MeshPlaces places = is_wrong ? of_mesh->wrong : MeshPlaces();
    if (solver.add_fold_samples(is_anew ? surface.barrier : how.barrier, *best.field, places) == 0) break;
    if (is_anew)
      how.anew();
    else
      solver.solve(how.steps, 0.0, progress);
    Candidate next = present();
    if (how.of_mesh && !is_better(next.measures, best.measures)) break;
    best = std::move(next);
  }
  return best;
}

Solution finish(Candidate solved, const SurfaceSamples& samples, const ObjectiveTerms& terms, LoopResult loop,
                const Progress& progress) {
  progress.report(0.98, "measuring the result");
  Solution solution =
      measured(std::move(solved.field), samples, terms, std::move(loop), std::move(solved.measures));
  solution.report.contact = solved.solved.contact;
  solution.report.terms = solved.solved.terms;
  for (LossTerm& term : solution.report.terms) term.value *= terms.rigidity;
  for (std::string& note : notes_on(solved.solved.contact))
    solution.report.warnings.push_back(std::move(note));
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
  const int more =
      std::min(FullSolve::most_for_exact, static_cast<int>(FullSolve::more_for_exact * options.centers));
  set_centers(fine, exact != nullptr ? std::max(options.centers, more) : options.centers, samples);
  fine.handle_weight = options.handles.handle_weight * (exact != nullptr ? FullSolve::share_of_exact : 1.0);
  const auto blend = exact != nullptr ? exact->blend : nullptr;
  const auto around = [&](std::shared_ptr<DeformationField> field) {
    return exact != nullptr ? exact->around(std::move(field)) : field;
  };
  const auto shape = std::make_shared<const RestShape>(
      samples, fine.interior, static_cast<std::uint64_t>(options.training.seed), progress, axis);
  std::shared_ptr<RadialField> first;
  ContactReport contact_first;
  if (exact != nullptr || fine.fine_centers >= FullSolve::min_centers_for_coarse_start) {
    LiveOptions few = live_options(options);
    few.symmetry = options.symmetry;
    few.locality = options.locality;
    set_centers(few, std::min(FullSolve::most_first, fine.fine_centers / 2), samples);
    few.handle_weight = (exact != nullptr ? followed_closely(options) : options).handles.handle_weight;
    few.tolerance = LiveOptions().tolerance;
    RadialSolver solver(samples, handles, few, progress.part(0.0, 0.1), shape);
    solver.set_contact(hooks.contact, true, progress);
    solver.solve(std::min(FullSolve::first_iterations, options.training.iterations), 0.0,
                 progress.part(0.1, 0.13));
    slide(solver, options.training.iterations, progress.part(0.13, 0.15));
    contact_first = solver.report().contact;
    first = solver.field();
    progress.preview([&](PointsIn points) { return around(first)->at(points); });
  }
  const double done = first ? 0.15 : 0.0;
  RadialSolver solver(samples, handles, fine, progress.part(done, 0.4), shape, blend);
  solver.set_contact(hooks.contact, true, progress);
  if (first) solver.adopt(*first, contact_first);
  const Shown shown = [&] { return around(solver.field()); };
  LoopResult loop = run(solver, options.training, progress.part(0.4, 0.95), hooks, 1.0, shown,
                        {.least_gain = FullSolve::least_gain});
  const ObjectiveTerms terms = measured_terms(samples, handles, *shape, options.surface);
  SolveHooks unseen = hooks;
  unseen.observer = nullptr;
  solver.set_hooks({hooks.energies, 1.0, {}, hooks.terms});
  Unfolding how{FullSolve::unfolding * std::max(options.surface.barrier, FullSolve::least_barrier)};
  how.rounds = was_ended(loop) || hooks.contact ? 0 : FullSolve::unfolding_rounds;
  how.steps = std::min(FullSolve::unfolding_iterations, options.training.iterations);
  how.of_mesh = true;
  how.anew = [&] {
    solver.reset();
    solver.set_targets(handles);
    if (first) solver.adopt(*first);
    const LoopResult again = run(solver, options.training, progress.part(0.95, 0.97), unseen, 1.0, shown,
                                 {.least_gain = FullSolve::least_gain});
    for (const auto& [iterations, value] : again.history)
      loop.history.emplace_back(loop.iterations + iterations, value);
    loop.iterations += again.iterations;
    loop.seconds += again.seconds;
  };
  Candidate best = unfold(solver, samples, options.surface, terms, how, shown, progress.part(0.97, 0.98));
  return finish(std::move(best), samples, terms, std::move(loop), progress);
}

DeformOptions followed_closely(DeformOptions options) {
  options.exact_handles = false;
  options.handles.handle_weight =
      std::min(FullSolve::closer * options.handles.handle_weight, FullSolve::heaviest);
  return options;
}

std::shared_ptr<const DeformationField> radial_start(const SurfaceSamples& samples,
                                                     const std::vector<Handle>& handles,
                                                     DeformOptions options, const Progress& progress) {
  if (options.exact_handles) options = followed_closely(options);
  options.invertibility = 0.0;
  options.training.iterations = FullSolve::start_iterations;
  return deform_radial(samples, handles, options, progress).field;
}

Solution stylize_radial(const SurfaceSamples& samples, const Style& style, const StylizeOptions& options,
                        const Progress& progress, const Vector& weights, const std::vector<Handle>& handles,
                        const Vec3& up, const SolveHooks& hooks) {
  // The solver's rigidity has weight 1: all other weights are divided by options.rigidity.
  LiveOptions live = live_options(options);
  live.locality.locality = 0.0;
  live.samples = std::min(FullSolve::most_style_samples, FullSolve::style_samples_a_center * options.centers);
  live.coarse_centers = 2 * options.centers / FullSolve::style_centers_a_coarse_pair;
  live.fine_centers = options.centers;
  live.fine_radius_factor = FullSolve::style_radius;
  live.tolerance = FullSolve::style_tolerance;
  live.handle_weight =
      std::max(options.handles.handle_weight, FullSolve::least_handle_weight) / options.rigidity;
  live.surface.barrier = options.surface.barrier / options.rigidity;
  live.gauss_weight = options.gauss_weight / options.rigidity;
  live.keep_stance = options.keep_stance / options.rigidity;
  live.interior = !handles.empty();  // a style alone acts everywhere alike
  const auto shape = std::make_shared<const RestShape>(
      samples, live.interior, static_cast<std::uint64_t>(options.training.seed), progress);
  // A style alone is solved at strength 1, and then goes its share of the way from rest.
  const bool alone = handles.empty() && !hooks.adds_terms() && !(hooks.contact && hooks.contact->any());
  const double solved = alone && options.strength > 0.0 ? 1.0 : options.strength;
  const double share = alone ? options.strength : 1.0;
  double worst = std::numeric_limits<double>::infinity();
  if (options.centers >= FullSolve::min_centers_for_coarse_start) {
    LiveOptions few = live;
    few.samples = FullSolve::style_first_samples;
    few.fine_centers = FullSolve::style_first_centers;
    few.coarse_centers = few.fine_centers / FullSolve::centers_a_coarse;
    RadialSolver quick(samples, handles, few, progress.part(0.0, 0.1), shape);
    quick.set_contact(hooks.contact, true, progress);
    quick.set_style(style, solved, options.sharpness, weights, up);
    quick.solve(std::min(FullSolve::style_first_iterations, options.training.iterations), 0.0,
                progress.part(0.1, 0.15));
    preview(progress, [&] { return quick.field(); }, share);
    worst = quick.report().value;
  }
  RadialSolver solver(samples, handles, live, progress.part(0.15, 0.3), shape);
  solver.set_contact(hooks.contact, true, progress);
  solver.set_style(style, solved, options.sharpness, weights, up);
  const Shown shown = [&] { return solver.field(); };
  const LoopResult loop =
      run(solver, options.training, progress.part(0.3, 0.95), hooks, options.rigidity, shown,
          {.worst = worst, .least_gain = FullSolve::least_style_gain, .share = share});
  solver.set_hooks({hooks.energies, 1.0 / options.rigidity, {}, hooks.terms});
  Unfolding how{FullSolve::unfolding * live.surface.barrier};
  how.rounds = options.surface.barrier > 0.0 && !was_ended(loop) ? FullSolve::unfolding_rounds : 0;
  how.steps = std::min(FullSolve::unfolding_iterations, options.training.iterations);
  how.all_samples = true;
  ObjectiveTerms terms = measured_terms(samples, handles, *shape, options.surface);
  terms.rigidity = options.rigidity;
  terms.style = StyleAtSamples::of(style, samples.normals, options.sharpness);
  Candidate best = unfold(solver, samples, options.surface, terms, how, shown, progress.part(0.95, 0.98));
  if (share < 1.0) {
    solver.set_style(style, options.strength, options.sharpness, weights, up);
    best = {shown(), solver.report(), {}};
  }
  return finish(std::move(best), samples, terms, loop, progress);
}

}  // namespace arapfields
