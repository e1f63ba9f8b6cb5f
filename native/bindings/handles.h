// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "bindings/arrays.h"
#include "energies/handles.h"

namespace arapfields::python {

/// The handles of an iterable. Throws InvalidInput that names the first item that is no handle.
inline std::vector<Handle> as_handles(const py::object& handles) {
  return as_items<Handle>(handles, "handles", "CuboidHandles, PointHandles or RegionHandles are needed");
}

}  // namespace arapfields::python
