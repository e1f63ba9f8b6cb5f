// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "fields/field.h"

namespace arapfields {

/// Options of invert; lengths in cube units.
struct InverseOptions {
  int iterations = 50;      ///< most evaluations a point and start
  double tolerance = 2e-6;  ///< largest residual ‖f(x) − y‖ of a point that counts as found
  double longest_step = 0.25;
};

struct InverseResult {
  Points points;  ///< (n,3); NaN where nothing was found
  Index failures = 0;
  double worst_residual = 0.0;  ///< over the points found
};

/// x with f(x) = y for every row y of `targets` (cube coordinates), by Newton's method with the field's own
/// Jacobian, its steps halved until the residual falls. It starts from the field's rest point whose image is
/// nearest to y, and where that fails from the nearest image of a grid over [-1,1]³, then from y itself.
/// Where f folds space there are several x: the start then decides.
InverseResult invert(const DeformationField& field, PointsIn targets, const InverseOptions& options = {},
                     const Progress& progress = {});

}  // namespace arapfields
