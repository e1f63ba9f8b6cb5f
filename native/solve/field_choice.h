// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "fields/field.h"
#include "optimize/training_loop.h"
#include "options/deform.h"
#include "options/stylize.h"

namespace arapfields {

/// What represents the motion: `field`, and where that is left to us, a network if any option that only
/// networks have is not at its default, else radial functions.
FieldKind chosen_field(const DeformOptions& options);
FieldKind chosen_field(const StylizeOptions& options);

/// The field that training starts from, for kinds that are trained. Throws InvalidInput for options that the
/// kind does not know.
std::shared_ptr<TrainableField> trained_field(const DeformOptions& options);
std::shared_ptr<TrainableField> trained_field(const StylizeOptions& options);

/// How the chosen kind is trained: with the options' learning rate, or its own where that is 0.
LoopOptions training_of(const DeformOptions& options);
LoopOptions training_of(const StylizeOptions& options);

}  // namespace arapfields
