// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/random.h"
#include "core/types.h"

namespace arapfields {

struct Box {
  Vec3 low = Vec3::Constant(-1.0);
  Vec3 high = Vec3::Constant(1.0);
  double area() const;
};

/// origin + t direction for t in [0, length]: a line's part inside a box.
struct Line {
  Vec3 origin;
  Vec3 direction;
  double length = 0.0;
  Vec3 at(double t) const { return origin + t * direction; }
};

/// A line from the rigid-motion invariant measure on all lines that hit the box, without rejection: its entry
/// is uniform on the box's surface and its direction follows Lambert's cosine law about the inward normal.
/// By Cauchy and Crofton its crossings are then uniform by area on any surface inside, 2 A / area() a line.
/// (Choosing the direction uniformly and then a face by |d_axis| gives axis-parallel lines too much weight:
/// a box's projection is not equally large from all sides; the density would vary with the normal by 1.8 %.)
Line random_line(const Box& box, Random& random);

}  // namespace arapfields
