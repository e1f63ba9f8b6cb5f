// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/neural_field.h"

#include "core/errors.h"
#include "core/parallel.h"
#include "neural/layers.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

void add_identity(JetView<double> jets, PointsIn points) {
  Eigen::Map<Points>(jets.column(0), jets.count, 3) += points;
  if (jets.order == JetOrder::value) return;
  for (int k = 0; k < 3; ++k)
    Eigen::Map<Points>(jets.column(first_column(k)), jets.count, 3).col(k).array() += 1.0;
}

void add_identity(Tensor& jets, const Tensor& points) {
  jets[0] += points;
  if (jets.size(0) == 1) return;
  for (int k = 0; k < 3; ++k) jets[first_column(k)].select(1, k) += 1.0;
}

/// Jets of the product a·p, a (columns, n, 1) and p (columns, n, 3).
Tensor jet_product(const Tensor& a, const Tensor& p) {
  Tensor result = a[0] * p;
  const auto columns = p.size(0);
  for (int64_t c = 1; c < columns; ++c) result[c].add_product(a[c], p[0]);
  if (columns < 10) return result;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      Tensor mixed = result[second_column(j, k)];
      mixed.add_product(a[first_column(j)], p[first_column(k)]);
      mixed.add_product(a[first_column(k)], p[first_column(j)]);
    }
  return result;
}

/// The transpose of jet_product(a, ·).
Tensor jet_product_back(const Tensor& a, const Tensor& cotangents) {
  Tensor result = a[0] * cotangents;
  const auto columns = cotangents.size(0);
  for (int64_t c = 1; c < columns; ++c) result[0].add_product(a[c], cotangents[c]);
  if (columns < 10) return result;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const Tensor mixed = cotangents[second_column(j, k)];
      result[first_column(k)].add_product(a[first_column(j)], mixed);
      result[first_column(j)].add_product(a[first_column(k)], mixed);
    }
  return result;
}

}  // namespace

NeuralField::NeuralField(const MlpShape& shape, std::uint64_t seed, bool double_precision,
                         const std::string& device)
    : network_(shape, seed, true, double_precision, device) {
  require(shape.outputs == 3, "outputs", std::to_string(shape.outputs), "a deformation has 3");
}

NeuralField::~NeuralField() = default;

std::vector<MatrixPlace> NeuralField::matrices() const { return hidden_matrices(network_.shape()); }

const MlpShape& NeuralField::shape() const { return network_.shape(); }

void NeuralField::fixed_part(PointsIn points, JetView<double> b, Vector& a) const {
  const ThreadScope scope;
  const Index n = points.rows();
  const int count = columns(b.order);
  if (base_) {
    base_->evaluate(points, b);
  } else {
    std::fill(b.data, b.data + b.size(), 0.0);
    add_identity(b, points);
  }
  a.resize(0);
  if (!handles_) return;
  a.resize(count * n);
  handles_->free_weight(points, b.order, a.data());
  JetBlock<double> blend(n, b.order);
  handles_->evaluate(points, blend.view());
  Tensor result = tensor_view(b);
  const Tensor exact = tensor_view(blend.view());
  if (!base_) {
    result.assign(exact);
    return;
  }
  JetBlock<double> identity(n, b.order);
  add_identity(identity.view(), points);
  result -= tensor_view(identity.view());
  result.assign(jet_product(tensor_view(a.data(), {count, n, 1}), result) + exact);
}

void NeuralField::evaluate(PointsIn points, JetView<double> out) const {
  const ThreadScope scope;
  require(out.count == points.rows(), "out", std::to_string(out.count) + " jets", "one a point is needed");
  if (out.count == 0) return;
  Vector a;
  fixed_part(points, out, a);
  const Tensor x = tensor_like(points, network_.parameters());
  Tensor jets = network_.evaluate(x, out.order).to_host().to(NumberType::float64);
  if (a.size() > 0) jets = jet_product(tensor_view(a.data(), {columns(out.order), out.count, 1}), jets);
  tensor_view(out).add(jets);
}

Tensor NeuralField::jets(const Tensor& points, JetOrder order) const {
  const ThreadScope scope;
  const Tensor& own = network_.parameters();
  if (base_ || handles_ || !alike(points, own)) return DeformationField::jets(points, order);
  Tensor jets = network_.evaluate(points.contiguous(), order);
  add_identity(jets, points);
  return jets;
}

Tensor NeuralField::forward(const Tensor& points, JetOrder order) {
  const ThreadScope scope;
  Tensor jets = network_.forward(points, order);
  factor_.reset();
  if (base_ || handles_) return compose(std::move(jets), points_of(points));
  add_identity(jets, points);
  return jets;
}

Tensor NeuralField::forward_at(PointsIn points, JetOrder order) {
  const ThreadScope scope;
  const Tensor x = tensor_like(points, network_.parameters());
  if (!base_ && !handles_) return forward(x, order);
  factor_.reset();
  return compose(network_.forward(x, order), points);
}

Tensor NeuralField::compose(Tensor jets, PointsIn points) {
  JetBlock<double> b(points.rows(), static_cast<JetOrder>(jets.size(0)));
  Vector a;
  fixed_part(points, b.view(), a);
  const Tensor fixed = tensor_like(b.view(), jets);
  if (a.size() == 0) return jets.add(fixed);
  factor_ =
      std::make_shared<Tensor>(tensor_like(tensor_view(a.data(), {jets.size(0), jets.size(1), 1}), jets));
  return jet_product(*factor_, jets).add(fixed);
}

void NeuralField::pull_back(const Tensor& cotangents) {
  const ThreadScope scope;
  network_.pull_back(factor_ ? jet_product_back(*factor_, cotangents) : cotangents);
}

void NeuralField::translate(const Vec3& offset) {
  Tensor bias = network_.bias(shape().layers);
  bias.add(tensor_like(offset, bias));
}

VectorF NeuralField::weights() const { return parameters_of(network_); }

void NeuralField::set_weights(const VectorF& weights) { set_parameters(network_, weights); }

}  // namespace arapfields
