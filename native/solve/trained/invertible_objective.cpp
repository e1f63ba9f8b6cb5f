// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/invertible_objective.h"

#include <algorithm>

#include "solve/trained/cycle.h"

namespace arapfields {

InvertibleObjective::InvertibleObjective(Objective& inner, const SurfaceSamples& samples, Index batch,
                                         double weight, const MlpShape& shape, const LoopOptions& options,
                                         const std::string& device)
    : inner_(inner),
      samples_(samples),
      batch_(batch),
      weight_(weight),
      options_(options),
      inverse_(shape, static_cast<std::uint64_t>(options.training.seed) + 1, false, device),
      optimizer_(trainable(inverse_), options.training, options.optimizer) {}

Tensor InvertibleObjective::accumulate(TrainableField& field, Random& random) {
  const Tensor inner = inner_.accumulate(field, random);
  Points x = uniform_in(-Vec3::Ones(), Vec3::Ones(), batch_, random);
  for (Index p = 0; p < batch_ / 2; ++p) x.row(p) = samples_.points.row(random.below(samples_.size()));
  const Tensor images = field.forward_at(x, JetOrder::value)[0];
  const Tensor jets = inverse_.forward(images, JetOrder::first);
  const Tensor residual = jets[0] - tensor_like(x, jets);
  const double scale = weight_ / static_cast<double>(batch_);
  Tensor inverse_cotangents = zeros_like(jets);
  inverse_cotangents[0].assign(residual * (2.0 / static_cast<double>(batch_)));
  field.pull_back((2.0 * scale * transposed_times(jets, residual)).unsqueeze(0));
  inverse_.gradient().set_zero();
  inverse_.pull_back(inverse_cotangents);
  const double done = static_cast<double>(done_) / std::max(1, options_.training.iterations);
  optimizer_.step(options_.schedule.share(done_++, done));
  cycle_ = std::make_shared<Tensor>(scale * sum(square(residual)));
  return inner + *cycle_;
}

std::vector<LossTerm> InvertibleObjective::terms() const {
  std::vector<LossTerm> terms = inner_.terms();
  if (cycle_) terms.push_back({"invertibility", cycle_->number()});
  return terms;
}

}  // namespace arapfields
