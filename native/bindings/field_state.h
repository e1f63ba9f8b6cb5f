// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "bindings/bind.h"
#include "fields/field.h"

namespace arapfields::python {

/// A field as a dict of NumPy arrays, numbers, strings and dicts (parts that are fields too), and back.
/// Reading throws InvalidInput for what is missing or does not fit.
py::dict field_state(const DeformationField& field);
std::shared_ptr<DeformationField> field_from_state(const py::dict& state);

}  // namespace arapfields::python
