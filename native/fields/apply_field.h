// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fields/field.h"

namespace arapfields {

/// Where a field takes points (n,3) of another mesh of the same shape, coarser, finer or of other topology,
/// `strength` of the way: x + strength (f(x) − x), mesh coordinates. A field is made for the surface that it
/// was solved on: throws InvalidInput naming `points` where over a tenth of them lie farther from that than
/// 0.1 of its size, and outside of the box around it.
ARAPFIELDS_EXPORT Points apply_field(const DeformationField& field, PointsIn points, double strength = 1.0);

}  // namespace arapfields
