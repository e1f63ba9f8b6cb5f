// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/export.h"
#include "core/types.h"

namespace arapfields {

/// Landmark multidimensional scaling (de Silva, Tenenbaum 2004): coordinates (n,3) whose squared distances
/// approximate `squares` (n, landmarks), those of the points from the landmarks, which are the first points.
/// They are the three leading coordinates; what lies along others is lost.
ARAPFIELDS_EXPORT_TO_TESTS Points classical_scaling(const RowMatrix<double>& squares);

/// Moves coordinates (n,3) so that the stress Σ w (|x_i − x_l| − d)² of each point i and all landmarks l
/// falls, where d² are `squares` and w `weights` (n, landmarks; positive): each point in turn goes to the
/// minimum of a quadratic bound of its own stress (de Leeuw's majorization), the landmarks first.
ARAPFIELDS_EXPORT_TO_TESTS void reduce_stress(const RowMatrix<double>& squares,
                                              const RowMatrix<double>& weights, Points& coordinates);

}  // namespace arapfields
