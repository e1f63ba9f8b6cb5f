// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/field_objective.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "distance/morton.h"
#include "energies/arap.h"
#include "energies/distortion.h"

namespace arapfields {
namespace {

template <class Scalar>
at::Tensor to_tensor(const PointsOf<Scalar>& points, const at::Tensor& like) {
  return at::from_blob(const_cast<Scalar*>(points.data()), {points.rows(), 3},
                       c10::CppTypeToScalarType<Scalar>::value)
      .to(like.options(), false, true);
}

/// The field's jets on the host and a zero block for their cotangents, which pull_back() hands over.
template <class Scalar>
struct HostJets {
  HostJets(TrainableField& field, const PointsOf<Scalar>& points, JetOrder order)
      : trained(field),
        jets(field.forward(to_tensor(points, field.parameters()), order).to(at::kCPU).contiguous()),
        cotangents(at::zeros_like(jets)),
        count(points.rows()),
        jet_order(order) {}
  JetView<const Scalar> view() const { return {jets.const_data_ptr<Scalar>(), count, jet_order}; }
  JetView<Scalar> cotangent_view() { return {cotangents.data_ptr<Scalar>(), count, jet_order}; }
  void pull_back() { trained.pull_back(cotangents.to(trained.parameters().device())); }

  TrainableField& trained;
  at::Tensor jets, cotangents;
  Index count;
  JetOrder jet_order;
};

}  // namespace

FieldObjective::FieldObjective(const SurfaceSamples& samples, ObjectiveTerms terms)
    : samples_(samples), terms_(std::move(terms)), order_(morton_order(samples.points)) {}

Index FieldObjective::next_fresh(Random& random) {
  if (used_ == pool_.size()) {
    pool_ = samples_.redraw(samples_.size(), random.bits() >> 1);
    used_ = 0;
  }
  return used_++;
}

double FieldObjective::accumulate(TrainableField& field, Random& random) {
  return field.parameters().scalar_type() == at::kDouble ? accumulate_as<double>(field, random)
                                                         : accumulate_as<float>(field, random);
}

template <class Scalar>
double FieldObjective::accumulate_as(TrainableField& field, Random& random) {
  const double surface = surface_terms<Scalar>(field, random);
  return surface + handle_terms<Scalar>(field, random);
}

template <class Scalar>
double FieldObjective::surface_terms(TrainableField& field, Random& random) {
  const Index available = samples_.size(), batch = std::min(terms_.batch, available);
  const bool styled = terms_.preference && terms_.gauss > 0.0;
  PointsOf<Scalar> points(batch, 3), normals(styled ? batch : 0, 3);
  Eigen::VectorX<Scalar> weights(styled && terms_.preference_weights.size() > 0 ? batch : 0);
  // Fresh samples stand evenly among the others: stretch b has one where b·fresh/batch steps up.
  for (Index b = 0; b < batch; ++b) {
    if (terms_.fresh > 0 && b * terms_.fresh / batch != (b + 1) * terms_.fresh / batch) {
      const Index i = next_fresh(random);
      points.row(b) = pool_.points.row(i).cast<Scalar>();
      if (styled) normals.row(b) = pool_.normals.row(i).cast<Scalar>();
      if (weights.size() > 0) weights[b] = Scalar(1);
      continue;
    }
    const double place = (static_cast<double>(b) + random.uniform()) * static_cast<double>(available) /
                         static_cast<double>(batch);
    const Index i = order_[static_cast<std::size_t>(std::min(available - 1, static_cast<Index>(place)))];
    points.row(b) = samples_.points.row(i).cast<Scalar>();
    if (styled) normals.row(b) = samples_.normals.row(i).cast<Scalar>();
    if (weights.size() > 0) weights[b] = static_cast<Scalar>(terms_.preference_weights[i]);
  }
  HostJets<Scalar> jets(field, points, terms_.bending > 0.0 ? JetOrder::second : JetOrder::first);
  const ArapValue arap =
      arap_energy<Scalar>(jets.view(), terms_.bending, terms_.rigidity, jets.cotangent_view());
  double value = terms_.rigidity * (arap.stretch + terms_.bending * arap.bend);
  if (styled)
    value += terms_.gauss * gauss_energy<Scalar>(jets.view(), normals, weights, *terms_.preference,
                                                 terms_.gauss, jets.cotangent_view());
  if (terms_.barrier > 0.0)
    value += terms_.barrier * fold_barrier<Scalar>(jets.view(), terms_.barrier_threshold, terms_.barrier,
                                                   jets.cotangent_view());
  jets.pull_back();
  return value;
}

template <class Scalar>
double FieldObjective::handle_terms(TrainableField& field, Random& random) const {
  if (terms_.handles.count() == 0 || terms_.handle_weight == 0.0) return 0.0;
  const HandleBatch<Scalar> batch = terms_.handles.batch<Scalar>(terms_.handle_batch, random);
  HostJets<Scalar> jets(field, batch.sources, JetOrder::value);
  const double value = handle_energy<Scalar>(jets.view(), batch, terms_.handle_weight, jets.cotangent_view());
  jets.pull_back();
  return terms_.handle_weight * value;
}

}  // namespace arapfields
