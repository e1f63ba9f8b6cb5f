// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/field_objective.h"

#include <algorithm>

#include "distance/morton.h"
#include "energies/arap.h"
#include "energies/composed_energies.h"
#include "energies/distortion.h"
#include "tensors/device_path.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// The field's jets in main memory and a zero block for their cotangents, which pull_back() hands over.
template <class Scalar>
struct HostJets {
  HostJets(TrainableField& field, const PointsOf<Scalar>& points, JetOrder order)
      : trained(field),
        jets(field.forward(tensor_view(points), order)),
        cotangents(zeros_like(jets)),
        count(points.rows()),
        jet_order(order) {}
  JetView<const Scalar> view() const { return {jets.data<Scalar>(), count, jet_order}; }
  JetView<Scalar> cotangent_view() { return {cotangents.data<Scalar>(), count, jet_order}; }
  void pull_back() { trained.pull_back(cotangents); }

  TrainableField& trained;
  Tensor jets, cotangents;
  Index count;
  JetOrder jet_order;
};

}  // namespace

struct FieldObjective::Constants {
  Constants(const ObjectiveTerms& terms, const Tensor& like) : tables(like) {
    const std::optional<GaussPreference>& preference = terms.style.preference;
    if (!preference) return;
    RowMatrix<double> rows(preference->normals.rows(), 4);
    rows << preference->normals, preference->weights;
    preferred = tensor_like(rows, like);
  }
  EnergyTables tables;
  Tensor preferred;
};

struct FieldObjective::Computed {
  const char* name;
  double on_host;
  Tensor on_device;
};

FieldObjective::FieldObjective(const SurfaceSamples& samples, ObjectiveTerms terms)
    : samples_(samples),
      terms_(std::move(terms)),
      order_(morton_order(samples.points)),
      bending_(bending_at(samples, terms_.stiffness)) {}

FieldObjective::~FieldObjective() = default;

Index FieldObjective::next_fresh(Random& random) {
  if (used_ == pool_.size()) {
    pool_ = samples_.redraw(samples_.size(), random.bits() >> 1);
    pool_bending_ = bending_at(pool_, terms_.stiffness);
    used_ = 0;
  }
  return used_++;
}

FieldObjective::Batch FieldObjective::draw(Random& random) {
  const Index available = samples_.size(), count = std::min(terms_.batch, available);
  Batch batch{Points(count, 3),
              Points(styled() ? count : 0, 3),
              Points(styled() && terms_.style.targets.rows() > 0 ? count : 0, 3),
              Vector(count),
              Vector(terms_.weights.size() > 0 ? count : 0),
              Vector(styled() && terms_.style.weights.size() > 0 ? count : 0),
              terms_.stance};
  batch.stance.ground.setZero(stands() ? count : 0);
  // Fresh samples are evenly spaced: interval b has one if ⌊b·fresh/count⌋ is below that of b + 1.
  for (Index b = 0; b < count; ++b) {
    if (terms_.fresh > 0 && b * terms_.fresh / count != (b + 1) * terms_.fresh / count) {
      const Index i = next_fresh(random);
      batch.points.row(b) = pool_.points.row(i);
      batch.bending[b] = pool_bending_[i];
      if (styled()) batch.normals.row(b) = pool_.normals.row(i);
      if (batch.weights.size() > 0) batch.weights[b] = pool_.weights.size() > 0 ? pool_.weights[i] : 1.0;
      if (batch.style_weights.size() > 0) batch.style_weights[b] = batch.targets.rows() > 0 ? 0.0 : 1.0;
      continue;
    }
    const double place = (static_cast<double>(b) + random.uniform()) * static_cast<double>(available) /
                         static_cast<double>(count);
    const Index i = order_[static_cast<std::size_t>(std::min(available - 1, static_cast<Index>(place)))];
    batch.points.row(b) = samples_.points.row(i);
    batch.bending[b] = bending_[i];
    if (styled()) batch.normals.row(b) = samples_.normals.row(i);
    if (batch.weights.size() > 0) batch.weights[b] = terms_.weights[i];
    if (batch.targets.rows() > 0) batch.targets.row(b) = terms_.style.targets.row(i);
    if (batch.style_weights.size() > 0) batch.style_weights[b] = terms_.style.weights[i];
    if (stands()) batch.stance.ground[b] = terms_.stance.ground[i];
  }
  return batch;
}

Tensor FieldObjective::accumulate(TrainableField& field, Random& random) {
  if (on_device_path(field.parameters())) return by_compositions(field, random);
  const bool wide = field.parameters().is_double();
  return scalar(wide ? by_kernels<double>(field, random) : by_kernels<float>(field, random));
}

template <class Scalar>
double FieldObjective::by_kernels(TrainableField& field, Random& random) {
  const Batch batch = draw(random);
  HostJets<Scalar> jets(field, batch.points.cast<Scalar>(), order_of_terms());
  const Eigen::VectorX<Scalar> bending = batch.bending.cast<Scalar>(), weights = batch.weights.cast<Scalar>();
  const ArapValue arap = arap_energy<Scalar>(jets.view(), terms_.stiffness.bends() ? 1.0 : 0.0,
                                             terms_.rigidity, jets.cotangent_view(),
                                             {weights.size() > 0 ? weights.data() : nullptr, bending.data()});
  computed_.clear();
  double value = 0.0;
  const auto add = [&](const char* name, double term) {
    computed_.push_back({name, term, {}});
    value += term;
  };
  add("stretch", terms_.rigidity * arap.stretch_energy);
  if (terms_.stiffness.bends()) add("bend", terms_.rigidity * (arap.energy - arap.stretch_energy));
  if (styled())
    add("style", terms_.gauss * style_energy<Scalar>(jets.view(), batch.normals.cast<Scalar>(),
                                                     terms_.style.preference, batch.targets.cast<Scalar>(),
                                                     batch.style_weights.cast<Scalar>(), terms_.gauss,
                                                     jets.cotangent_view()));
  if (stands())
    add("stance",
        terms_.keep_stance * stance_energy<Scalar>(jets.view(), batch.points.cast<Scalar>(), batch.stance,
                                                   terms_.keep_stance, jets.cotangent_view()));
  if (terms_.barrier > 0.0)
    add("barrier", terms_.barrier * fold_barrier<Scalar>(jets.view(), terms_.barrier_threshold,
                                                         terms_.barrier, jets.cotangent_view()));
  external_ =
      external_energies<Scalar>(terms_.external, batch.points, jets.view(), 1.0, jets.cotangent_view());
  for (const double term : external_) value += term;
  jets.pull_back();
  if (!pulled()) return value;
  const HandleBatch<Scalar> pairs = terms_.handles.batch<Scalar>(terms_.pull.handle_batch, random);
  HostJets<Scalar> ends(field, pairs.sources, JetOrder::value);
  const double off =
      handle_energy<Scalar>(ends.view(), pairs, terms_.pull.handle_weight, ends.cotangent_view());
  ends.pull_back();
  add("handles", terms_.pull.handle_weight * off);
  return value;
}

Tensor FieldObjective::by_compositions(TrainableField& field, Random& random) {
  const Tensor& like = field.parameters();
  if (!constants_) constants_ = std::make_unique<Constants>(terms_, like);
  const EnergyTables& tables = constants_->tables;
  const Batch batch = draw(random);
  const Tensor jets = field.forward_at(batch.points, order_of_terms());
  const Tensor cotangents = zeros_like(jets);
  const Tensor none;
  const ComposedFactors factors{batch.weights.size() > 0 ? tensor_like(batch.weights, like) : none,
                                tensor_like(batch.bending, like)};
  const Tensor arap =
      composed_arap(jets, terms_.stiffness.bends() ? 1.0 : 0.0, terms_.rigidity, tables, cotangents, factors);
  computed_.clear();
  Tensor value = zeros({}, arap);
  const auto add = [&](const char* name, const Tensor& term) {
    computed_.push_back({name, 0.0, term});
    value += term;
  };
  add("stretch", terms_.rigidity * arap[3]);
  if (terms_.stiffness.bends()) add("bend", terms_.rigidity * (arap[2] - arap[3]));
  if (styled()) {
    const Tensor normals = tensor_like(batch.normals, like);
    const Tensor held = batch.style_weights.size() > 0 ? tensor_like(batch.style_weights, like) : none;
    const auto& preference = terms_.style.preference;
    add("style",
        terms_.gauss * (preference ? composed_gauss(jets, normals, held, constants_->preferred,
                                                    preference->sharpness, terms_.gauss, tables, cotangents)
                                   : composed_targets(jets, normals, held, tensor_like(batch.targets, like),
                                                      terms_.gauss, tables, cotangents)));
  }
  if (stands()) {
    const double weight = terms_.keep_stance * batch.stance.scale;
    add("stance",
        weight * composed_stance(jets, tensor_like(batch.points, like),
                                 tensor_like(Vector(batch.stance.up), like),
                                 tensor_like(batch.stance.ground, like), weight, tables, cotangents));
  }
  if (terms_.barrier > 0.0)
    add("barrier", terms_.barrier *
                       composed_barrier(jets, terms_.barrier_threshold, terms_.barrier, tables, cotangents));
  if (!terms_.external.empty()) add_external(batch.points, jets, cotangents, value);
  field.pull_back(cotangents);
  if (!pulled()) return value;
  const HandleBatch<double> pairs = terms_.handles.batch<double>(terms_.pull.handle_batch, random);
  const Tensor ends = field.forward_at(pairs.sources, JetOrder::value);
  const Tensor pull = zeros_like(ends);
  add("handles", terms_.pull.handle_weight * composed_handles(ends, tensor_like(pairs.targets, like),
                                                              tensor_like(pairs.weights, like),
                                                              terms_.pull.handle_weight, pull));
  field.pull_back(pull);
  return value;
}

void FieldObjective::add_external(const Points& points, const Tensor& jets, Tensor cotangents,
                                  Tensor& value) {
  const Tensor host = doubles_of(jets), derivatives = zeros_like(host);
  const auto order = static_cast<JetOrder>(host.size(0));
  external_ = external_energies<double>(terms_.external, points, {host.data<double>(), points.rows(), order},
                                        1.0, {derivatives.data<double>(), points.rows(), order});
  cotangents += tensor_like(derivatives, jets);
  for (const double term : external_) value += term;
}

std::vector<LossTerm> FieldObjective::terms() const {
  std::vector<LossTerm> result;
  for (const Computed& term : computed_)
    result.push_back({term.name, term.on_device.defined() ? term.on_device.number() : term.on_host});
  for (std::size_t i = 0; i < external_.size(); ++i)
    result.push_back({"energies[" + std::to_string(i) + "]", external_[i]});
  return result;
}

}  // namespace arapfields
