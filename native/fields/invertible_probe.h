// SPDX-License-Identifier: GPL-3.0-or-later
// An invertible field with given numbers, in double precision on plain arrays: for comparison.
#pragma once

#include "core/jets.h"
#include "neural/coupling_shape.h"

namespace arapfields {

/// Jets (columns, n, 3) at points (n,3), row by row; for given cotangents (the same size, or none) the flat
/// parameter gradient; and preimages() of the jets' values.
struct InvertibleProbe {
  Vector jets, gradient;
  Points preimages;
};
ARAPFIELDS_EXPORT_TO_TESTS InvertibleProbe probe_invertible(const CouplingShape& shape,
                                                            const Vector& parameters, PointsIn points,
                                                            JetOrder order, const Vector& cotangents);

}  // namespace arapfields
