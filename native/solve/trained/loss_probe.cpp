// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/loss_probe.h"

#include "core/parallel.h"
#include "fields/neural_field.h"
#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "solve/trained/objective.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

std::shared_ptr<const HandleBlend> exact_blend(const BoundHandles& handles, double margin) {
  std::vector<RigidRegion> regions;
  for (Index i = 0; i < handles.count(); ++i)
    regions.push_back({handles.handle(i).rest, handles.motion(i), margin, ""});
  return std::make_shared<HandleBlend>(std::move(regions));
}

}  // namespace

struct LossProbe::State {
  State(const SurfaceSamples& given, int width, ObjectiveTerms terms, const std::string& device)
      : samples(given),
        field(MlpShape{{width, 2, 2, 1.0, 5.0}, 3}, 0, true, device),
        objective(samples, std::move(terms)) {}

  SurfaceSamples samples;
  NeuralField field;
  FieldObjective objective;
};

LossProbe::LossProbe(const SurfaceSamples& samples, const std::vector<Handle>& handles, int width,
                     double bending, const Points& preferred, double gauss, double barrier, double margin,
                     double keep_stance, const ExternalEnergies& external, const std::string& device) {
  ObjectiveTerms terms;
  terms.batch = 20;
  terms.external = external;
  terms.stiffness = SurfaceStiffness(bending);
  if (preferred.rows() > 0) terms.style.preference = gauss_preference(preferred, 5.0);
  terms.gauss = gauss;
  terms.keep_stance = keep_stance;
  terms.stance = Stance::of(samples.points, Vec3(0.1, 0.2, 1.0));
  terms.barrier = barrier;
  terms.barrier_threshold = 0.9;
  terms.handles = BoundHandles(handles, samples.points);
  terms.pull.handle_batch = 8;
  state_ = std::make_unique<State>(samples, width, std::move(terms), device);
  if (margin > 0.0)
    state_->field.set_handles(exact_blend(state_->objective.objective_terms().handles, margin));
}

LossProbe::~LossProbe() = default;

Index LossProbe::size() const { return state_->field.parameters().count(); }

LossGradient LossProbe::operator()(const Vector& parameters, std::uint64_t seed) {
  const ThreadScope scope;
  NeuralField& field = state_->field;
  require(parameters.size() == size(), "parameters", std::to_string(parameters.size()) + " numbers",
          std::to_string(size()) + " are needed");
  field.parameters().assign(tensor_view(parameters));
  field.gradient().set_zero();
  Random random(seed);
  const double loss = state_->objective.accumulate(field, random).number();
  return {loss, vector_of(field.gradient())};
}

struct EnergyTrial::State {
  State(const SurfaceSamples& given, ObjectiveTerms terms)
      : samples(given), field(MlpShape{}, 0), objective(samples, std::move(terms)), random(0) {}

  SurfaceSamples samples;
  NeuralField field;
  FieldObjective objective;
  Random random;
};

EnergyTrial::EnergyTrial(const SurfaceSamples& samples, Index batch, double bending) {
  ObjectiveTerms terms;
  terms.batch = batch;
  terms.stiffness = SurfaceStiffness(bending);
  state_ = std::make_unique<State>(samples, std::move(terms));
  state_->field.network()->weight(state_->field.shape().layers).fill(0.01);
}

EnergyTrial::~EnergyTrial() = default;

double EnergyTrial::run() {
  const ThreadScope scope;
  state_->field.gradient().set_zero();
  return state_->objective.accumulate(state_->field, state_->random).number();
}

Vector probe_thickness(const SurfaceSamples& samples) {
  const LocalThickness thickness(samples.points, samples.normals, canonical_order(samples.points),
                                 samples.sheet_sizes);
  return thickness.at(samples.points) * samples.frame.scale;
}

Vector probe_bending(const SurfaceSamples& samples, const SurfaceOptions& options) {
  return SurfaceStiffness(samples, options).bending(samples.points);
}

RowMatrix<double> probe_radial_rows(const RadialField& field, PointsIn points, JetOrder order) {
  return radial_rows(field.basis(), points, order);
}

}  // namespace arapfields
