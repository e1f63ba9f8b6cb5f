// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "fields/field.h"
#include "optimize/training_loop.h"
#include "options/deform.h"
#include "options/stylize.h"

namespace arapfields {

/// The kind of field: `options.field`. For "auto", a network if an option that only networks have is not at
/// its default, else radial functions.
FieldKind chosen_field(const DeformOptions& options);
FieldKind chosen_field(const StylizeOptions& options);

/// The field that training starts from, for the trained kinds. Throws InvalidInput for options that the kind
/// does not have.
template <class Options>
std::shared_ptr<TrainableField> trained_field(const Options& options);

/// How the chosen kind is trained. A learning rate of 0 means the kind's own.
template <class Options>
LoopOptions training_of(const Options& options);

}  // namespace arapfields
