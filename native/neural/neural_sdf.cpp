// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/neural_sdf.h"

#include <ATen/ATen.h>

#include "core/errors.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

at::Tensor as_tensor(ConstPointsRef<float> points, const Mlp& mlp) {
  return at::from_blob(const_cast<float*>(points.data()), {points.rows(), 3}, {points.outerStride(), 1},
                       at::kFloat)
      .to(mlp.parameters().options())
      .contiguous();
}

void copy_out(const at::Tensor& from, float* to, Index stride) {
  at::Tensor target = from.dim() == 1 ? at::from_blob(to, {from.size(0)}, at::kFloat)
                                      : at::from_blob(to, {from.size(0), 3}, {stride, 1}, at::kFloat);
  target.copy_(from);
}

}  // namespace

NeuralSdf::NeuralSdf(Mlp mlp, const Frame& frame) : mlp_(std::move(mlp)), frame_(frame) {
  require(mlp_.shape().outputs == 1, "network", std::to_string(mlp_.shape().outputs) + " outputs",
          "a distance function has one");
}

std::shared_ptr<NeuralSdf> NeuralSdf::from_layers(const Layers& layers, int octaves, double frequency,
                                                  double sharpness, const Frame& frame) {
  const MlpShape shape = shape_of(layers, octaves, frequency, sharpness);
  return std::make_shared<NeuralSdf>(make_mlp(layers, shape), frame);
}

void NeuralSdf::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const {
  const ThreadScope scope;
  if (points.rows() == 0) return;
  copy_out(mlp_.evaluate(as_tensor(points, mlp_), JetOrder::value).view({-1}), values.data(), 1);
}

void NeuralSdf::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                         Eigen::Ref<PointsF> gradients) const {
  const ThreadScope scope;
  if (points.rows() == 0) return;
  at::Tensor value, gradient;
  mlp_.evaluate_with_gradient(as_tensor(points, mlp_), value, gradient);
  copy_out(value, values.data(), 1);
  copy_out(gradient, gradients.data(), gradients.outerStride());
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
