// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/inverse_training.h"

#include "core/parallel.h"
#include "fields/neural_field.h"
#include "solve/setup.h"
#include "solve/trained/objective.h"
#include "tensors/device.h"

namespace arapfields {
namespace {

/// Cycle error, in cube units, above which a point's weight falls off: away from the surface f may fold
/// space, and has no inverse there.
constexpr double believable = 0.02;

/// (n, 1) weight of each point in the cycle's gradient: 1 for small errors where f is an isometry, less for
/// large errors and where J would magnify them.
Tensor share_of(const Tensor& jets, const Tensor& cycle) {
  const Tensor missed = sum(square(cycle), {1}, true) / (believable * believable);
  const Tensor stretch = sum(square(jets.slice(0, first_column(0), first_column(3))), {0, 2});
  return 1.0 / ((1.0 + missed) * clamp_min(stretch / 3.0, 1.0).unsqueeze(1));
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

  Tensor accumulate(TrainableField& inverse, Random& random) override {
    const Index surface = (batch_ + 1) / 2;
    Points y(batch_, 3), x(surface, 3);
    for (Index p = 0; p < surface; ++p) {
      const Index i = random.below(rest_.rows());
      y.row(p) = images_.row(i);
      x.row(p) = rest_.row(i);
    }
    y.bottomRows(batch_ - surface) = uniform_in(low_, high_, batch_ - surface, random);
    const Tensor images = tensor_like(y, inverse.parameters());
    const Tensor back = inverse.forward(images, JetOrder::value)[0];
    const Tensor jets = field_.jets(back, JetOrder::first);
    const Tensor cycle = jets[0] - images;
    const Tensor direct = back.slice(0, 0, surface) - tensor_like(x, images);
    const double scale = 1.0 / static_cast<double>(batch_);
    Tensor cotangents = 2.0 * scale * share_of(jets, cycle) * transposed_times(jets, cycle);
    cotangents.slice(0, 0, surface).add(direct, 2.0 * scale);
    inverse.pull_back(cotangents.unsqueeze(0));
    return scale * (sum(square(cycle)) + sum(square(direct)));
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
  loop.training = options.training;
  loop.schedule.hold_fraction = 0.3;
  loop.schedule.final_share = 0.01;
  Points images(rest.rows(), 3);
  field.evaluate(rest, {images.data(), rest.rows(), JetOrder::value});
  inverse->set_rest_points(images.topRows(std::min<Index>(images.rows(), 4000)));
  const auto measured = [&](LoopResult result) {
    Points back(rest.rows(), 3);
    inverse->evaluate(images, {back.data(), rest.rows(), JetOrder::value});
    const Vector error = (back - rest).rowwise().norm() * field.frame().scale;
    Solution solution{inverse, {}};
    solution.report.loop = std::move(result);
    solution.report.handle_mean = {error.mean()};
    solution.report.handle_max = {error.maxCoeff()};
    return solution;
  };
  try {
    return measured(minimise(*inverse, objective, loop, progress));
  } catch (const LoopDiverged& cause) {
    throw SolveDiverged(cause, measured(cause.result));
  }
}

}  // namespace arapfields
