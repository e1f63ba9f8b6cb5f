// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "fields/field.h"
#include "splats/gaussian_splats.h"

namespace arapfields {

constexpr double default_max_stretch = 2.0;

/// Splats moved by a field: μ' = f(μ), Σ' = J Σ Jᵀ. The axes stay in their order. Colours turn by the
/// rotation closest to J; opacities stay. A Gaussian that the field stretches by more than `max_stretch`
/// along an axis, or bends, is divided into two along it first, which have its mean and covariance together.
/// Each such half is σ/2 wide and √3/2 σ away. Splats keep their rows; what is new comes after them. Throws
/// InvalidInput for splats that do not fit together and for max_stretch < 1, and Cancelled.
ARAPFIELDS_EXPORT GaussianSplats move_splats(const DeformationField& field, GaussianSplats splats,
                                             double max_stretch = default_max_stretch,
                                             const Progress& progress = {});

}  // namespace arapfields
