// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

/// Points of a shape that may consist of several, possibly intersecting surfaces: body, hair, shoes.
struct PiecePoints {
  Points points;              ///< (n,3)
  Points normals;             ///< (n,3) unit length, outwards
  std::vector<Index> pieces;  ///< (n) index of each point's surface
  Index count() const;        ///< number of surfaces
};

/// For each point p with normal n the row of `others` (q, m) that minimises |p − q|² + turn² |n − m|². If a
/// surface has at least `enough` others, its points take one of them.
std::vector<Index> nearest_on_own(const PiecePoints& points, const PiecePoints& others, double turn,
                                  Index enough);

}  // namespace arapfields
