// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

/// Points of a shape that may be of several surfaces, which may cut each other: body, hair, shoes.
struct PiecePoints {
  Points points;              ///< (n,3)
  Points normals;             ///< (n,3) unit length, outwards
  std::vector<Index> pieces;  ///< (n) which surface each lies on, from 0
  Index count() const;        ///< of surfaces
};

/// For each of some points the other with the least |p − q|² + turn² |n − m|². Those of a surface on which
/// there are at least so many others have one of these.
std::vector<Index> nearest_on_own(const PiecePoints& points, const PiecePoints& others, double turn,
                                  Index enough);

}  // namespace arapfields
