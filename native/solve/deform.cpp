// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/deform.h"

#include <algorithm>
#include <numeric>

#include "core/parallel.h"
#include "energies/shared_motion.h"
#include "fields/neural_field.h"
#include "sampling/parts.h"
#include "solve/field_choice.h"
#include "solve/held_parts.h"
#include "solve/radial/full_solve.h"
#include "solve/report.h"
#include "solve/setup.h"
#include "solve/trained/objective.h"
#include "solve/warnings.h"
#include "tensors/device.h"

namespace arapfields {
namespace {

std::shared_ptr<const HandleBlend> exact_blend(const BoundHandles& handles, double margin,
                                               std::vector<std::string>& warnings) {
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
      region.placement.topRightCorner<3, 1>() = handles.sources().row(handles.begin(i));
    }
    regions.push_back(region);
    members.push_back(
        handles.sources().middleRows(handles.begin(i), handles.begin(i + 1) - handles.begin(i)));
  }
  warnings = limit_margins(regions, members);
  return std::make_shared<HandleBlend>(std::move(regions));
}

ObjectiveTerms terms_of(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                        const DeformOptions& options) {
  ObjectiveTerms terms;
  terms.batch = options.training.batch;
  terms.fresh = std::min(options.fresh_samples, options.training.batch);
  terms.stiffness = SurfaceStiffness(samples, options.surface);
  terms.barrier = options.surface.barrier;
  terms.barrier_threshold = options.surface.barrier_threshold;
  terms.handles = bound_handles(handles, samples);
  require_within_reach(terms.handles, samples.points);
  terms.pull = options.handles;
  terms.locality.options = options.locality;
  if (terms.locality.acts()) {
    terms.locality.motion = shared_motion(terms.handles, samples.size());
    std::vector<Index> rows(static_cast<std::size_t>(samples.size()));
    std::iota(rows.begin(), rows.end(), Index{0});
    const std::vector<Index> parts = parts_of(samples.points);
    terms.locality.shares = locality_shares(samples.points, rows, terms.handles, terms.handles.sources(),
                                            {samples.points, parts});
  }
  terms.weights = energy_weights(samples, terms.handles);
  if (options.exact_handles) terms.pull.handle_weight = 0.0;
  return terms;
}

/// A radial field blended with the handles' motions, stored as a neural field whose network is zero.
Solution exact_radial(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                      const DeformOptions& options, const Progress& progress, const SolveHooks& hooks) {
  const BoundHandles bound = bound_handles(handles, samples);
  std::vector<std::string> warnings;
  ExactHandles exact{exact_blend(bound, options.margin, warnings), {}};
  exact.around = [&](std::shared_ptr<const DeformationField> inside) {
    MlpShape shape{options.network, 3};
    shape.width = shape.layers = shape.octaves = 1;
    auto field = std::make_shared<NeuralField>(shape, 0);
    field->set_base(inside);
    field->set_handles(exact.blend);
    field->set_frame(samples.frame);
    field->set_rest_points(inside->rest_points());
    return field;
  };
  Solution solution = deform_radial(samples, handles, options, progress, hooks, &exact);
  solution.report.warnings.insert(solution.report.warnings.begin(), warnings.begin(), warnings.end());
  return solution;
}

}  // namespace

Solution deform(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                const DeformOptions& options, const Progress& progress, const SolveHooks& hooks) {
  options.validate();
  require_samples(samples);
  require(!handles.empty(), "handles", "none were given", "at least one is needed");
  require(options.fresh_samples == 0 || samples.redraw, "options.fresh_samples",
          "the samples are a plain list of points",
          "samples of sample_mesh or sample_surface are needed, which know their surface");
  if (options.exact_handles) require_no_reach(handles, "exact_handles");
  if (chosen_field(options) == FieldKind::radial)
    return options.exact_handles ? exact_radial(samples, handles, options, progress, hooks)
                                 : deform_radial(samples, handles, options, progress, hooks);
  require(options.symmetry == SymmetryPlane::none, "options.symmetry",
          std::string(name_of(options.symmetry)) + " with options of a network", "it needs field='radial'");
  require(!hooks.contact || !hooks.contact->any(), "contact", "with options of a network",
          "it needs field='radial'");
  require_no_reach(handles, "a network");
  const ThreadScope threads(options.machine.threads);
  ObjectiveTerms terms = terms_of(samples, handles, options);
  terms.external = hooks.energies;
  terms.further = hooks.terms;

  const std::shared_ptr<TrainableField> field = trained_field(options);
  auto* const neural = dynamic_cast<NeuralField*>(field.get());  // other kinds have neither blend nor base
  std::vector<std::string> warnings;
  if (options.exact_handles) neural->set_handles(exact_blend(terms.handles, options.margin, warnings));
  const double share = options.start == StartKind::radial ? 0.1 : 0.0;
  if (options.start == StartKind::radial)
    neural->set_base(radial_start(samples, handles, options, progress.part(0.0, share)));

  LoopOptions loop = training_of(options);
  loop.observer = hooks.observer;
  terms.estimates = static_cast<Index>(loop.training.iterations) * loop.steps;
  WrapObjective wrap;
  if (options.invertibility > 0.0)
    wrap = [&](Objective& inner) {
      return std::make_unique<InvertibleObjective>(inner, samples, options.training.batch,
                                                   options.invertibility, neural->shape(), loop,
                                                   resolve_device(options.machine.device));
    };
  Solution solution = solve_field(field, samples, std::move(terms), loop, progress.part(share, 1.0), wrap);
  solution.report.warnings.insert(solution.report.warnings.begin(), warnings.begin(), warnings.end());
  return solution;
}

}  // namespace arapfields
