// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <pybind11/pybind11.h>

namespace arapfields::python {

/// To be called when all is bound: from then on an argument that is of the wrong type, missing or unknown
/// raises InvalidInput that names it (a TypeError, too), where pybind11 alone lists the whole signature.
void name_wrong_types(const pybind11::module_& module);

}  // namespace arapfields::python
