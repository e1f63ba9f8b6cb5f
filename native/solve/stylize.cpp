// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/stylize.h"

#include "core/parallel.h"
#include "solve/field_choice.h"
#include "solve/radial/full_solve.h"
#include "solve/report.h"
#include "solve/setup.h"
#include "solve/warnings.h"

namespace arapfields {
namespace {

void check_samples(const SurfaceSamples& samples, const Vector& weights) {
  require_samples(samples);
  require(samples.normals.rows() == samples.size(), "samples", "they have no normals",
          "stylize needs one a sample");
  if (weights.size() == 0) return;
  require(weights.size() == samples.size(), "weights", std::to_string(weights.size()) + " numbers",
          std::to_string(samples.size()) + ", one a sample, are needed");
  require(weights.allFinite() && weights.minCoeff() >= 0.0, "weights", "some are negative or not finite",
          "all must be 0 or larger");
}

/// A point handle that holds the lowest sample in place.
Handle lowest_point(const SurfaceSamples& samples, const Vec3& up) {
  Index lowest = 0;
  (samples.points * up).minCoeff(&lowest);
  Handle handle;
  handle.kind = Handle::Kind::point;
  handle.rest_point = handle.target_point = samples.points.row(lowest);
  return handle;
}

/// Translates the field so that the lowest point keeps its height, and the middle its place seen along `up`;
/// no other term depends on translations.
void anchor(TrainableField& field, const Vec3& lowest, PointsIn samples, const Vec3& up) {
  const Points places = anchor_places(lowest, samples);
  Points values(places.rows(), 3);
  field.evaluate(places, {values.data(), places.rows(), JetOrder::value});
  field.translate(anchoring_shift(places, values, up));
}

}  // namespace

Solution stylize(const SurfaceSamples& samples, const Style& style, const StylizeOptions& options,
                 const Progress& progress, const Vector& weights, const std::vector<Handle>& handles,
                 const Vec3& up, const SolveHooks& hooks) {
  options.validate();
  check_samples(samples, weights);
  require_no_reach(handles);
  if (chosen_field(options) == FieldKind::radial)
    return stylize_radial(samples, style, options, progress, weights, handles, up, hooks);
  require(!hooks.contact || !hooks.contact->any(), "contact", "with options of a network",
          "it needs field='radial'");
  const ThreadScope threads(options.machine.threads);
  ObjectiveTerms terms;
  terms.batch = options.training.batch;
  terms.rigidity = options.rigidity;
  terms.stiffness = SurfaceStiffness(samples, options.surface);
  terms.barrier = options.surface.barrier;
  terms.barrier_threshold = options.surface.barrier_threshold;
  terms.style = StyleAtSamples::of(style, samples.normals, options.sharpness);
  if (!terms.style.idle(samples.normals))
    terms.gauss = terms.style.share(options.strength) * options.gauss_weight * terms.style.factor;
  if (weights.size() > 0) terms.style.weights = terms.style.weights.cwiseProduct(weights);
  terms.external = hooks.energies;
  terms.further = hooks.terms;
  const Handle lowest = lowest_point(samples, up);
  terms.handles = handles.empty() ? BoundHandles({lowest}, samples.points) : bound_handles(handles, samples);
  require_within_reach(terms.handles, samples.points);
  terms.weights = energy_weights(samples, terms.handles);
  terms.pull = options.handles;
  if (handles.empty()) {
    terms.pull.handle_weight = 1.0;
    terms.keep_stance = options.keep_stance;
    terms.stance = Stance::of(samples.points, up);
  }

  const std::shared_ptr<TrainableField> field = trained_field(options);
  LoopOptions loop = training_of(options);
  loop.observer = hooks.observer;
  if (terms.gauss == 0.0 && handles.empty() && !hooks.adds_terms()) loop.training.iterations = 0;
  Solution solution = solve_field(field, samples, std::move(terms), loop, progress);
  if (handles.empty()) {
    if (!hooks.adds_terms()) anchor(*field, lowest.rest_point, samples.points, up);
    solution.report.handle_mean.clear();
    solution.report.handle_max.clear();
  }
  return solution;
}

}  // namespace arapfields
