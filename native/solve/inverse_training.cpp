// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/inverse_training.h"

#include <ATen/ATen.h>

#include "core/parallel.h"
#include "solve/options.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

at::Tensor to_tensor(const Points& points, const at::Tensor& like) {
  return at::from_blob(const_cast<double*>(points.data()), {points.rows(), 3}, at::kDouble)
      .to(like.options(), false, true);
}

Points to_points(const at::Tensor& tensor) {
  const at::Tensor host = tensor.to(at::kCPU, at::kDouble).contiguous();
  return Eigen::Map<const Points>(host.const_data_ptr<double>(), host.size(0), 3);
}

Points uniform_in(const Vec3& low, const Vec3& high, Index count, Random& random) {
  Points points(count, 3);
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i) points(p, i) = random.uniform(low[i], high[i]);
  return points;
}

/// Rows J_pᵀ r_p.
Points transposed_times(JetView<const double> jets, const Points& residuals) {
  Points result(residuals.rows(), 3);
  for (Index p = 0; p < residuals.rows(); ++p)
    for (int k = 0; k < 3; ++k)
      result(p, k) = residuals.row(p).dot(Eigen::Map<const Eigen::RowVector3d>(jets.at(first_column(k), p)));
  return result;
}

/// Trains g for a fixed f.
class CycleObjective final : public Objective {
 public:
  CycleObjective(const DeformationField& field, const Points& rest, Index batch)
      : field_(field), rest_(rest), images_(rest.rows(), 3), batch_(batch) {
    field.evaluate(rest_, {images_.data(), rest_.rows(), JetOrder::value});
    const Vec3 low = images_.colwise().minCoeff(), high = images_.colwise().maxCoeff();
    const Vec3 margin = 0.1 * (high - low);
    low_ = low - margin, high_ = high + margin;
  }

  double accumulate(TrainableField& inverse, Random& random) override {
    const Index surface = (batch_ + 1) / 2;
    Points y(batch_, 3), x(surface, 3);
    for (Index p = 0; p < surface; ++p) {
      const Index i = random.below(rest_.rows());
      y.row(p) = images_.row(i);
      x.row(p) = rest_.row(i);
    }
    y.bottomRows(batch_ - surface) = uniform_in(low_, high_, batch_ - surface, random);
    const Points back = to_points(inverse.forward(to_tensor(y, inverse.parameters()), JetOrder::value)[0]);
    JetBlock<double> jets(batch_, JetOrder::first);
    field_.evaluate(back, jets.view());
    const Points cycle = Eigen::Map<const Points>(jets.view().data, batch_, 3) - y;
    const Points direct = back.topRows(surface) - x;
    const double scale = 1.0 / static_cast<double>(batch_);
    Points cotangents = 2.0 * scale * transposed_times(jets.view(), cycle);
    cotangents.topRows(surface) += 2.0 * scale * direct;
    inverse.pull_back(to_tensor(cotangents, inverse.parameters()).unsqueeze(0));
    return scale * (cycle.squaredNorm() + direct.squaredNorm());
  }

 private:
  const DeformationField& field_;
  const Points& rest_;
  Points images_;
  Vec3 low_, high_;
  Index batch_;
};

}  // namespace

void InverseTrainingOptions::validate() const {
  DeformOptions common;
  common.iterations = iterations;
  common.batch = batch;
  common.learning_rate = learning_rate;
  common.optimizer = optimizer;
  common.time_budget = time_budget;
  common.threads = threads;
  common.device = device;
  common.validate();
}

Solution train_inverse(const DeformationField& field, const SurfaceSamples& samples,
                       const InverseTrainingOptions& options, const Progress& progress) {
  options.validate();
  require_samples(samples);
  const ThreadScope threads(options.threads);
  const MlpShape shape{
      3, options.width, options.layers, options.octaves, options.frequency, options.sharpness};
  const auto seed = static_cast<std::uint64_t>(options.seed);
  auto inverse = std::make_shared<NeuralField>(shape, seed, false, resolve_device(options.device));
  inverse->set_frame(field.frame());
  const Points rest = field.frame().to_cube(samples.frame.to_mesh(samples.points));
  CycleObjective objective(field, rest, options.batch);
  LoopOptions loop;
  loop.stage = "inverse";
  loop.optimizer = options.optimizer;
  loop.iterations = options.iterations;
  loop.learning_rate = options.learning_rate;
  loop.final_share = 0.01;
  loop.hold = 0.3;
  loop.time_budget = options.time_budget;
  loop.seed = seed;
  Solution solution{inverse, {}};
  solution.report.loop = minimise(*inverse, objective, loop, progress);
  Points images(rest.rows(), 3), back(rest.rows(), 3);
  field.evaluate(rest, {images.data(), rest.rows(), JetOrder::value});
  inverse->set_rest_points(images.topRows(std::min<Index>(images.rows(), 4000)));
  inverse->evaluate(images, {back.data(), rest.rows(), JetOrder::value});
  const Vector error = (back - rest).rowwise().norm() * field.frame().scale;
  solution.report.handle_mean = {error.mean()};
  solution.report.handle_max = {error.maxCoeff()};
  return solution;
}

InvertibleObjective::InvertibleObjective(Objective& inner, const SurfaceSamples& samples, Index batch,
                                         double weight, const MlpShape& shape, const LoopOptions& options,
                                         const std::string& device)
    : inner_(inner),
      samples_(samples),
      batch_(batch),
      weight_(weight),
      iterations_(std::max(1, options.iterations)),
      inverse_(shape, options.seed + 1, false, device),
      stepper_(inverse_, options) {}

double InvertibleObjective::accumulate(TrainableField& field, Random& random) {
  const double inner = inner_.accumulate(field, random);
  Points x = uniform_in(-Vec3::Ones(), Vec3::Ones(), batch_, random);
  for (Index p = 0; p < batch_ / 2; ++p) x.row(p) = samples_.points.row(random.below(samples_.size()));
  const at::Tensor images = field.forward(to_tensor(x, field.parameters()), JetOrder::value)[0];
  const at::Tensor jets = inverse_.forward(images, JetOrder::first);
  const at::Tensor residual = jets[0] - to_tensor(x, jets);
  const double scale = weight_ / static_cast<double>(batch_);
  at::Tensor inverse_cotangents = at::zeros_like(jets);
  inverse_cotangents[0].copy_(residual * (2.0 / static_cast<double>(batch_)));
  at::Tensor cotangents = at::empty_like(residual);
  for (int k = 0; k < 3; ++k)
    cotangents.select(1, k).copy_((jets[first_column(k)] * residual).sum(1) * (2.0 * scale));
  field.pull_back(cotangents.unsqueeze(0));
  inverse_.gradient().zero_();
  inverse_.pull_back(inverse_cotangents);
  stepper_.step(stepper_.rate(static_cast<double>(done_++) / iterations_));
  return inner + scale * residual.square().sum().item<double>();
}

}  // namespace arapfields
