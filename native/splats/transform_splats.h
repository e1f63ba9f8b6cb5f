// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "splats/gaussian_splats.h"

namespace arapfields {

/// Splats under an affine map x → A x + t: centers, covariances A Σ Aᵀ, and colours turned by the rotation
/// closest to A. Throws InvalidInput that names `matrix` where its last row is not (0, 0, 0, 1) or det A is
/// not above 0, as for splats that do not fit together, and Cancelled.
ARAPFIELDS_EXPORT GaussianSplats transform_splats(const GaussianSplats& splats, const Mat4& matrix,
                                                  const Progress& progress = {});

}  // namespace arapfields
