// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/field_objective.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <numeric>

#include "energies/arap.h"
#include "energies/distortion.h"

namespace arapfields {
namespace {

/// Interleaves the bits of the three coordinates' cells of the cube [-1,1]³, 21 bits each.
std::uint64_t morton_code(const Vec3& point) {
  std::uint64_t code = 0;
  for (int i = 0; i < 3; ++i) {
    const double unit = std::clamp(0.5 * (point[i] + 1.0), 0.0, 1.0);
    std::uint64_t bits = static_cast<std::uint64_t>(unit * 2097151.0);
    bits = (bits | bits << 32) & 0x1f00000000ffffULL;
    bits = (bits | bits << 16) & 0x1f0000ff0000ffULL;
    bits = (bits | bits << 8) & 0x100f00f00f00f00fULL;
    bits = (bits | bits << 4) & 0x10c30c30c30c30c3ULL;
    bits = (bits | bits << 2) & 0x1249249249249249ULL;
    code |= bits << i;
  }
  return code;
}

std::vector<Index> morton_order(PointsIn points) {
  std::vector<std::uint64_t> codes(static_cast<std::size_t>(points.rows()));
  for (std::size_t i = 0; i < codes.size(); ++i) codes[i] = morton_code(points.row(static_cast<Index>(i)));
  std::vector<Index> order(codes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
    return codes[static_cast<std::size_t>(a)] < codes[static_cast<std::size_t>(b)];
  });
  return order;
}

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

double FieldObjective::accumulate(TrainableField& field, Random& random) {
  return field.parameters().scalar_type() == at::kDouble ? accumulate_as<double>(field, random)
                                                         : accumulate_as<float>(field, random);
}

template <class Scalar>
double FieldObjective::accumulate_as(TrainableField& field, Random& random) const {
  const double surface = surface_terms<Scalar>(field, random);
  return surface + handle_terms<Scalar>(field, random);
}

template <class Scalar>
double FieldObjective::surface_terms(TrainableField& field, Random& random) const {
  const Index available = samples_.size(), batch = std::min(terms_.batch, available);
  const bool styled = terms_.preference && terms_.gauss > 0.0;
  PointsOf<Scalar> points(batch, 3), normals(styled ? batch : 0, 3);
  Eigen::VectorX<Scalar> weights(styled && terms_.preference_weights.size() > 0 ? batch : 0);
  for (Index b = 0; b < batch; ++b) {
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
