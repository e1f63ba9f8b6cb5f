// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/field_choice.h"

namespace arapfields {
namespace {

/// Whether a network's shape, training, precision or device is asked for.
template <class Options>
bool names_a_network(const Options& given) {
  const Options usual;
  return given.network != usual.network || given.training.optimizer != usual.training.optimizer ||
         given.training.learning_rate != usual.training.learning_rate ||
         given.training.batch != usual.training.batch || given.precision != usual.precision ||
         given.machine.device.starts_with("cuda");
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

}  // namespace arapfields
