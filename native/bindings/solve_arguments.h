// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "bindings/arrays.h"
#include "energies/handles.h"
#include "energies/style.h"
#include "energies/styles.h"

namespace arapfields::python {

/// The handles of an iterable. Throws InvalidInput that names the first item that is no handle.
inline std::vector<Handle> as_handles(const py::object& handles) {
  return as_items<Handle>(handles, "handles", "CuboidHandles, PointHandles or RegionHandles are needed");
}

/// A style's name, preferred normals (k,3), or an ObjectStyle.
inline Style as_style(const NormalsArgument& style, const std::string& name = "normals") {
  if (py::isinstance<py::str>(style)) return preferred_normals(py::cast<std::string>(style));
  if (py::isinstance<ObjectStyle>(style)) return py::cast<ObjectStyle>(style);
  return as_points(style, name);
}

/// as_style(), rotated.
inline Style turned_style(const NormalsArgument& normals, const std::optional<ArrayArgument>& orientation) {
  Style style = as_style(normals);
  if (!orientation) return style;
  const Mat3 turn = as_rotation(*orientation, "orientation");
  if (style.object) return style.object->turned(turn);
  return Points(style.preferred * turn.transpose());
}

}  // namespace arapfields::python
