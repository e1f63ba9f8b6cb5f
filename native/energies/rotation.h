// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// The rotation R (det +1) that maximises tr(RᵀJ), that is, minimises ‖J − R‖_F. It is defined for every J;
/// where two signed singular values cancel it is one of several, and it is the identity for J = 0.
ARAPFIELDS_EXPORT Mat3 closest_rotation(const Mat3& jacobian);

/// The same for `count` matrices, vectorised and parallel. In and out are blocks (3, count, 3) as the first
/// derivatives of a jet: entry (i, k) of point p is data[(k·count + p)·3 + i].
template <class Scalar>
ARAPFIELDS_EXPORT void closest_rotations(const Scalar* jacobians, Index count, Scalar* rotations);

}  // namespace arapfields
