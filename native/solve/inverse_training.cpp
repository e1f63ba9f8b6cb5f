// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/inverse_training.h"

#include <ATen/ATen.h>

#include "core/device.h"
#include "core/parallel.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

at::Tensor to_tensor(const Points& points, const at::Tensor& like) {
  const at::Tensor host = at::from_blob(const_cast<double*>(points.data()), {points.rows(), 3}, at::kDouble);
  return upload(host.to(like.scalar_type()), like);
}

Points uniform_in(const Vec3& low, const Vec3& high, Index count, Random& random) {
  Points points(count, 3);
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i) points(p, i) = random.uniform(low[i], high[i]);
  return points;
}

/// Rows J_pᵀ r_p.
at::Tensor transposed_times(const at::Tensor& jets, const at::Tensor& residuals) {
  return (jets.slice(0, first_column(0), first_column(3)) * residuals).sum(2).t();
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

  at::Tensor accumulate(TrainableField& inverse, Random& random) override {
    const Index surface = (batch_ + 1) / 2;
    Points y(batch_, 3), x(surface, 3);
    for (Index p = 0; p < surface; ++p) {
      const Index i = random.below(rest_.rows());
      y.row(p) = images_.row(i);
      x.row(p) = rest_.row(i);
    }
    y.bottomRows(batch_ - surface) = uniform_in(low_, high_, batch_ - surface, random);
    const at::Tensor images = to_tensor(y, inverse.parameters());
    const at::Tensor back = inverse.forward(images, JetOrder::value)[0];
    const at::Tensor jets = field_.jets(back, JetOrder::first);
    const at::Tensor cycle = jets[0] - images;
    const at::Tensor direct = back.slice(0, 0, surface) - to_tensor(x, images);
    const double scale = 1.0 / static_cast<double>(batch_);
    at::Tensor cotangents = 2.0 * scale * transposed_times(jets, cycle);
    cotangents.slice(0, 0, surface).add_(direct, 2.0 * scale);
    inverse.pull_back(cotangents.unsqueeze(0));
    return scale * (cycle.square().sum() + direct.square().sum());
  }

 private:
  const DeformationField& field_;
  const Points& rest_;
  Points images_;
  Vec3 low_, high_;
  Index batch_;
};

}  // namespace

Solution train_inverse(const DeformationField& field, const SurfaceSamples& samples,
                       const InverseTrainingOptions& options, const Progress& progress) {
  options.validate();
  require_samples(samples);
  const ThreadScope threads(options.machine.threads);
  auto inverse = std::make_shared<NeuralField>(MlpShape{options.network, 3},
                                               static_cast<std::uint64_t>(options.training.seed), false,
                                               resolve_device(options.machine.device));
  inverse->set_frame(field.frame());
  const Points rest = field.frame().to_cube(samples.frame.to_mesh(samples.points));
  CycleObjective objective(field, rest, options.training.batch);
  LoopOptions loop;
  loop.stage = "inverse";
  loop.training = options.training;
  loop.final_share = 0.01;
  loop.lr_hold_fraction = 0.3;
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
      iterations_(std::max(1, options.training.iterations)),
      inverse_(shape, static_cast<std::uint64_t>(options.training.seed) + 1, false, device),
      optimizer_(inverse_, options) {}

at::Tensor InvertibleObjective::accumulate(TrainableField& field, Random& random) {
  const at::Tensor inner = inner_.accumulate(field, random);
  Points x = uniform_in(-Vec3::Ones(), Vec3::Ones(), batch_, random);
  for (Index p = 0; p < batch_ / 2; ++p) x.row(p) = samples_.points.row(random.below(samples_.size()));
  const at::Tensor images = field.forward_at(x, JetOrder::value)[0];
  const at::Tensor jets = inverse_.forward(images, JetOrder::first);
  const at::Tensor residual = jets[0] - to_tensor(x, jets);
  const double scale = weight_ / static_cast<double>(batch_);
  at::Tensor inverse_cotangents = at::zeros_like(jets);
  inverse_cotangents[0].copy_(residual * (2.0 / static_cast<double>(batch_)));
  field.pull_back((2.0 * scale * transposed_times(jets, residual)).unsqueeze(0));
  inverse_.gradient().zero_();
  inverse_.pull_back(inverse_cotangents);
  optimizer_.step(optimizer_.rate(static_cast<double>(done_++) / iterations_));
  return inner + scale * residual.square().sum();
}

}  // namespace arapfields
