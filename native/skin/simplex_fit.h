// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

constexpr Index most_candidates = 12;  ///< bones that a point's weights are sought among
using FewBones = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, most_candidates, 1>;
using BonePairs = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_candidates, most_candidates>;

/// Weights ≥ 0 of sum one, at most so many above 0, with the least wᵀHw/2 − gᵀw.
FewBones simplex_minimum(const BonePairs& h, const FewBones& g, int influences);

}  // namespace arapfields
