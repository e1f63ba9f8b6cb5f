// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// Names that preferred_normals knows, in the order in which a menu should show them.
ARAPFIELDS_EXPORT std::vector<std::string> style_names();

/// Unit face normals (k,3) of the named solid; z is its axis where it has one. Curved sides of the cylinder
/// and the cone are rings of 32. Throws InvalidInput that lists the names.
ARAPFIELDS_EXPORT Points preferred_normals(const std::string& name);

}  // namespace arapfields
