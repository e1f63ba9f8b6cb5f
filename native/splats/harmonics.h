// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

constexpr int most_harmonics = 16;  // of bands 0 to 3

/// The first `count` (1, 4, 9 or 16) real spherical harmonics in a unit direction, with the signs and the
/// order of Gaussian splats' files.
ARAPFIELDS_EXPORT_TO_TESTS Eigen::Matrix<double, most_harmonics, 1> harmonics_at(const Vec3& direction,
                                                                                 int count);

/// Turns colours (3 k), k = 1, 4, 9 or 16 harmonics of three channels each, with their object: in a direction
/// R d they are then what they were in d. Each band is turned by its real Wigner matrix P Y(RᵀD). D are seven
/// directions, Y the band's functions there, and P the left inverse of Y(D).
void turn_harmonics(const Mat3& rotation, Eigen::Ref<Eigen::RowVectorXf> colours);

}  // namespace arapfields
