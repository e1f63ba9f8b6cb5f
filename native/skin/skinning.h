// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

enum class SkinMethod { linear, dual_quaternion };

/// Vertices (n,3) moved by blends of the bones' motions from rest, with weights (n, bones). Dual quaternions
/// (Kavan et al. 2008) take rigid motions alone. Throws InvalidInput for counts that differ and for numbers
/// that are not finite.
ARAPFIELDS_EXPORT Points skin(PointsIn vertices, const RowMatrix<float>& weights,
                              const std::vector<Mat4>& motions, SkinMethod method = SkinMethod::linear);

}  // namespace arapfields
