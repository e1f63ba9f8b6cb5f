// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <pybind11/pybind11.h>

namespace arapfields::python {

/// To be called when all is bound: from then on an argument of the wrong type raises InvalidInput that names
/// it (of a kind that is a TypeError too), where pybind11 alone lists the whole signature.
void name_wrong_types(const pybind11::module_& module);

}  // namespace arapfields::python
