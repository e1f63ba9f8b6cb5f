// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/neural_sdf.h"

#include "core/errors.h"
#include "core/parallel.h"
#include "neural/layers.h"
#include "tensors/views.h"

namespace arapfields {
NeuralSdf::NeuralSdf(Mlp mlp, const Frame& frame)
    : mlp_(std::make_unique<Mlp>(std::move(mlp))), frame_(frame) {
  require(shape().outputs == 1, "network", std::to_string(shape().outputs) + " outputs",
          "a distance function has one");
}

NeuralSdf::~NeuralSdf() = default;

const MlpShape& NeuralSdf::shape() const { return mlp_->shape(); }

Layers NeuralSdf::layers() const { return layers_of(*mlp_); }

std::shared_ptr<NeuralSdf> NeuralSdf::from_layers(const Layers& layers, int octaves, double frequency,
                                                  double sharpness, const Frame& frame) {
  const MlpShape shape = shape_of(layers, octaves, frequency, sharpness);
  return std::make_shared<NeuralSdf>(make_mlp(layers, shape), frame);
}

void NeuralSdf::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const {
  const ThreadScope scope;
  if (points.rows() == 0) return;
  tensor_view(values).assign(
      mlp_->evaluate(tensor_like(points, mlp_->parameters()), JetOrder::value).view({-1}));
}

void NeuralSdf::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                         Eigen::Ref<PointsF> gradients) const {
  const ThreadScope scope;
  if (points.rows() == 0) return;
  Tensor value, gradient;
  mlp_->evaluate_with_gradient(tensor_like(points, mlp_->parameters()), value, gradient);
  tensor_view(values).assign(value);
  tensor_view(gradients).assign(gradient);
}

Vector NeuralSdf::distances(PointsIn points) const {
  const Points cube = frame_.to_cube(points), inside = cube.cwiseMax(-1.0).cwiseMin(1.0);
  VectorF values(points.rows());
  evaluate(inside.cast<float>(), values);
  return frame_.scale * (values.cast<double>() + (cube - inside).rowwise().norm());
}

Points NeuralSdf::gradients(PointsIn points) const {
  const Points cube = frame_.to_cube(points), inside = cube.cwiseMax(-1.0).cwiseMin(1.0);
  VectorF values(points.rows());
  PointsF slopes(points.rows(), 3);
  evaluate(inside.cast<float>(), values, slopes);
  Points result = slopes.cast<double>();
  const Points beyond = cube - inside;
  for (Index i = 0; i < points.rows(); ++i) {
    const double length = beyond.row(i).norm();
    if (length == 0.0) continue;
    for (int k = 0; k < 3; ++k)
      if (beyond(i, k) != 0.0) result(i, k) = 0.0;  // the nearest point does not move along this axis
    result.row(i) += beyond.row(i) / length;
  }
  return result;
}

}  // namespace arapfields
