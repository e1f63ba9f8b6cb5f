// SPDX-License-Identifier: GPL-3.0-or-later
// Rules on several options at once. Those on one are ranges in options.toml.
#include "core/errors.h"
#include "options/deform.h"

namespace arapfields {

void check_together(const DeformOptions& o) {
  if (o.field != FieldKind::radial) return;
  const std::string with = " with field='radial'", allowed = "it needs field='neural'";
  require(o.surface.barrier == 0.0, "barrier", number_text(o.surface.barrier) + with, allowed);
  require(o.invertibility == 0.0, "invertibility", number_text(o.invertibility) + with, allowed);
}

}  // namespace arapfields
