// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/lines.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace arapfields {

double Box::area() const {
  const Vec3 size = high - low;
  return 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
}

Line random_line(const Box& box, Random& random) {
  const Vec3 size = box.high - box.low;
  double pick = random.uniform(0.0, box.area());
  int face = 0;  // axis·2 + side
  for (; face < 5; ++face) {
    const double area = size[(face / 2 + 1) % 3] * size[(face / 2 + 2) % 3];
    if (pick < area) break;
    pick -= area;
  }
  const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
  const bool upper = face % 2 == 1;
  Line line;
  line.origin[axis] = upper ? box.high[axis] : box.low[axis];
  line.origin[u] = random.uniform(box.low[u], box.high[u]);
  line.origin[v] = random.uniform(box.low[v], box.high[v]);
  // Malley's method: a uniform point of the disk, embedded to the hemisphere, is cosine-distributed.
  const double square = random.uniform(), angle = random.uniform(0.0, 2.0 * std::numbers::pi);
  line.direction[u] = std::sqrt(square) * std::cos(angle);
  line.direction[v] = std::sqrt(square) * std::sin(angle);
  line.direction[axis] = (upper ? -1.0 : 1.0) * std::sqrt(1.0 - square);
  line.length = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    if (line.direction[k] == 0.0) continue;
    const double exit = (line.direction[k] > 0.0 ? box.high[k] : box.low[k]) - line.origin[k];
    line.length = std::min(line.length, exit / line.direction[k]);
  }
  return line;
}

}  // namespace arapfields
