// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/segments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace arapfields {
namespace {

/// Rounding errors of coordinates in [-1,1], by which triangles and boxes are enlarged, so that a segment
/// does not slip through between two triangles.
constexpr double slack = 1e-12;
constexpr double none = std::numeric_limits<double>::infinity();

/// Lowers `first` to the parameter at which the segment meets one of a packet's triangles.
void meet(const TrianglePacket& packet, const Vec3& from, const Vec3& way, const std::int32_t* labels,
          std::int32_t label, double& first) {
  for (int i = 0; i < tree_width; ++i) {
    const double bx = packet.bx[i], cx = packet.cx[i], cy = packet.cy[i];
    if (!(bx * cy > 0.0) || (labels != nullptr && labels[packet.triangle[i]] != label)) continue;
    double start[3] = {}, step[3] = {};
    const double* const axes[3] = {&packet.axis_x[0][i], &packet.axis_y[0][i], &packet.axis_z[0][i]};
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < 3; ++k) {
        const double axis = axes[a][k * tree_width];
        start[a] += axis * (from[k] - packet.origin[k][i]);
        step[a] += axis * way[k];
      }
    if (step[2] == 0.0) continue;
    const double t = -start[2] / step[2];
    if (!(t >= 0.0 && t <= 1.0 && t < first)) continue;
    const double x = start[0] + t * step[0], y = start[1] + t * step[1];
    if (y >= -slack && x * cy - y * cx >= -slack * (cy + std::abs(cx)) &&
        y * (cx - bx) - (x - bx) * cy >= -slack * (cy + std::abs(cx - bx)))
      first = t;
  }
}

}  // namespace

double first_crossing(const HierarchyView& tree, const Vec3& from, const Vec3& to, const std::int32_t* labels,
                      std::int32_t label) {
  const Vec3 way = to - from;
  Vec3 inverse;
  for (int k = 0; k < 3; ++k)
    inverse[k] = 1.0 / (std::abs(way[k]) > 1e-200 ? way[k] : std::copysign(1e-200, way[k]));
  double first = none;
  std::array<std::int32_t, stack_size> stack;
  int pending = 0;
  stack[pending++] = 0;
  while (pending > 0) {
    const WideNode& node = tree.nodes[stack[--pending]];
    for (int i = 0; i < node.count; ++i) {
      double enter = 0.0, leave = std::min(first, 1.0);
      for (int k = 0; k < 3; ++k) {
        const double low = (static_cast<double>(node.low[k][i]) - slack - from[k]) * inverse[k];
        const double high = (static_cast<double>(node.high[k][i]) + slack - from[k]) * inverse[k];
        enter = std::max(enter, std::min(low, high));
        leave = std::min(leave, std::max(low, high));
      }
      if (enter > leave) continue;
      if (node.child[i] >= 0)
        stack[pending++] = node.child[i];
      else
        meet(tree.packets[~node.child[i]], from, way, labels, label, first);
    }
  }
  return first;
}

}  // namespace arapfields
