// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <pybind11/pybind11.h>

namespace arapfields::python {

/// To be called when all classes are bound: from then on an object that was made by a bare __new__ raises
/// TypeError wherever it is used.
void refuse_uninitialised(const pybind11::module_& module);

}  // namespace arapfields::python
