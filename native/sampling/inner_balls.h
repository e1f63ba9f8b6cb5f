// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Rules for the witnesses that bound a ball.
struct InnerBallRules {
  double most = 1.0;          ///< radius where nothing bounds a ball
  double least_cosine = 0.0;  ///< between the inward normal and the direction to a witness; flatter ones are
                              ///< taken for the surface's own roughness
  double near = 0.0;  ///< within this distance, witnesses that face the point count as planes: the other
                      ///< side of a sheet thinner than the spacing of witnesses
};

/// Radii (n) of the largest balls that touch the surface at points (n,3) with outward unit normals (n,3) from
/// inside and hold none of the witnesses (m,3), samples of the surface with their normals.
Vector inner_radii(PointsIn points, PointsIn normals, PointsIn witnesses, PointsIn witness_normals,
                   const InnerBallRules& rules);

}  // namespace arapfields
