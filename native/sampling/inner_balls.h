// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Rules for the witnesses that bound a ball.
struct InnerBallRules {
  double most = 1.0;          ///< radius of an unbounded ball
  double least_cosine = 0.0;  ///< between the inward normal and the direction to a witness; witnesses at
                              ///< flatter angles, due to roughness, are ignored
  double near = 0.0;  ///< within this distance, witnesses that face the point bound the ball as planes, at
                      ///< flat angles if they face it squarely: the other side of a sheet may be thinner than
                      ///< the witnesses' spacing
};

/// Radii (n) of the largest inscribed balls that touch the surface at points (n,3) with outward unit normals
/// (n,3) and contain none of the witnesses (m,3), samples of the surface with their normals.
Vector inner_radii(PointsIn points, PointsIn normals, PointsIn witnesses, PointsIn witness_normals,
                   const InnerBallRules& rules);

}  // namespace arapfields
