// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

constexpr Index most_candidates = 12;  ///< most candidate bones of a point
using FewBones = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most_candidates, 1>;
using BonePairs = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_candidates, most_candidates>;

/// argmin wᵀHw/2 − gᵀw over w ≥ 0 of sum one, with at most `influences` entries above 0 (chosen greedily).
FewBones simplex_minimum(const BonePairs& h, const FewBones& g, int influences);

}  // namespace arapfields
