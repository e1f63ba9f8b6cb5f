// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/field_choice.h"

#include <algorithm>

#include "core/errors.h"
#include "fields/invertible_field.h"
#include "fields/neural_field.h"
#include "tensors/device.h"

namespace arapfields {
namespace {

/// Whether an option of a network's shape, training, precision or device is not at its default.
template <class Options>
bool names_a_network(const Options& given) {
  const Options usual;
  return given.network != usual.network || given.training.optimizer != usual.training.optimizer ||
         given.training.learning_rate != usual.training.learning_rate ||
         given.training.batch != usual.training.batch || given.precision != usual.precision ||
         given.machine.device.starts_with("cuda");
}

/// The coupling layers' networks are narrower and shallower than that of a neural field.
CouplingShape coupling_shape(NetworkOptions network, int couplings) {
  network.width = std::max(1, network.width / 4);
  network.layers = std::max(1, network.layers / 2);
  CouplingShape shape{network};
  shape.couplings = couplings;
  return shape;
}

}  // namespace

FieldKind chosen_field(const DeformOptions& options) {
  if (options.field != FieldKind::automatic) return options.field;
  const DeformOptions usual;
  const bool network = names_a_network(options) || options.start != usual.start ||
                       options.fresh_samples != usual.fresh_samples ||
                       options.invertibility != usual.invertibility;
  return network ? FieldKind::neural : FieldKind::radial;
}

FieldKind chosen_field(const StylizeOptions& options) {
  if (options.field != FieldKind::automatic) return options.field;
  return names_a_network(options) ? FieldKind::neural : FieldKind::radial;
}

template <class Options>
std::shared_ptr<TrainableField> trained_field(const Options& options) {
  const auto seed = static_cast<std::uint64_t>(options.training.seed);
  if (chosen_field(options) == FieldKind::invertible) {
    const std::string with = " with field='invertible'";
    require(options.precision == ProductPrecision::float32, "precision", name_of(options.precision) + with,
            "it computes in 'float32'");
    require(!options.machine.device.starts_with("cuda"), "device", options.machine.device + with,
            "it computes on the processor: 'auto' or 'cpu'");
    return std::make_shared<InvertibleField>(coupling_shape(options.network, options.couplings), seed);
  }
  auto field = std::make_shared<NeuralField>(MlpShape{options.network, 3}, seed, false,
                                             resolve_device(options.machine.device));
  field->network()->round_products(options.precision == ProductPrecision::bfloat16);
  return field;
}

/// Coupling layers are composed, so a change of one passes through all later ones: they take smaller steps,
/// and more of them, which their narrow networks make up for.
template <class Options>
LoopOptions training_of(const Options& options) {
  LoopOptions loop;
  loop.training = options.training;
  if (chosen_field(options) != FieldKind::invertible) return loop;
  if (loop.training.learning_rate == 0.0)
    loop.training.learning_rate = TrainingOptions::automatic_learning_rate(options.training.optimizer) / 5.0;
  loop.optimizer.momentum = 0.9;
  loop.steps = 8;
  return loop;
}

template std::shared_ptr<TrainableField> trained_field(const DeformOptions&);
template std::shared_ptr<TrainableField> trained_field(const StylizeOptions&);
template LoopOptions training_of(const DeformOptions&);
template LoopOptions training_of(const StylizeOptions&);

}  // namespace arapfields
