// SPDX-License-Identifier: GPL-3.0-or-later
// Rules on several options at once. Those on one are ranges in options.toml.
#include "core/errors.h"
#include "options/deform.h"

namespace arapfields {

void check_together(const DeformOptions& o) {
  if (o.symmetry != SymmetryPlane::none) {
    const std::string with = std::string(name_of(o.symmetry)) + " with ";
    require(o.field != FieldKind::neural, "symmetry", with + "field='neural'", "it needs field='radial'");
    require(o.field != FieldKind::invertible, "symmetry", with + "field='invertible'",
            "it needs field='radial'");
    require(!o.exact_handles, "symmetry", with + "exact_handles", "it needs handles that pull");
  }
  if (o.field == FieldKind::invertible) {
    const std::string with = " with field='invertible'", allowed = "it needs field='neural'";
    require(!o.exact_handles, "exact_handles", "True" + with,
            "a blend with fixed motions cannot be inverted: it needs field='radial' or 'neural'");
    require(o.start == StartKind::identity, "start", std::string(name_of(o.start)) + with, allowed);
    require(o.invertibility == 0.0, "invertibility", number_text(o.invertibility) + with,
            "it is invertible as it is");
  }
  if (o.field != FieldKind::radial) return;
  const std::string with = " with field='radial'", allowed = "it needs field='neural'";
  require(o.invertibility == 0.0, "invertibility", number_text(o.invertibility) + with, allowed);
}

}  // namespace arapfields
