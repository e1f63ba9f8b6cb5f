// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include "distance/kernels.h"

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int W = tree_width;
/// Rounding errors of coordinates in [-1,1], by which triangles and boxes are enlarged, so that a segment
/// does not slip through between two triangles.
constexpr double slack = 1e-12;
constexpr double none = std::numeric_limits<double>::infinity();

/// Lowers `first` to the parameter at which the segment from + t way meets one of a packet's triangles.
void meet(const TrianglePacket& p, const double* from, const double* way, const std::int32_t* labels,
          std::int32_t label, double& first) {
  alignas(64) double hits[W];
  for (int i = 0; i < W; ++i) {
    const double dx = from[0] - p.origin[0][i], dy = from[1] - p.origin[1][i], dz = from[2] - p.origin[2][i];
    const double height = p.axis_z[0][i] * dx + p.axis_z[1][i] * dy + p.axis_z[2][i] * dz;
    const double fall = p.axis_z[0][i] * way[0] + p.axis_z[1][i] * way[1] + p.axis_z[2][i] * way[2];
    const double t = -height / (fall == 0.0 ? 1.0 : fall);
    const double x = p.axis_x[0][i] * (dx + t * way[0]) + p.axis_x[1][i] * (dy + t * way[1]) +
                     p.axis_x[2][i] * (dz + t * way[2]);
    const double y = p.axis_y[0][i] * (dx + t * way[0]) + p.axis_y[1][i] * (dy + t * way[1]) +
                     p.axis_y[2][i] * (dz + t * way[2]);
    const double bx = p.bx[i], cx = p.cx[i], cy = p.cy[i], ex = cx - bx;
    const bool hit = (fall != 0.0) & (bx * cy > 0.0) & (t >= 0.0) & (t <= 1.0) & (y >= -slack) &
                     (x * cy - y * cx >= -slack * (cy + std::fabs(cx))) &
                     (y * ex - (x - bx) * cy >= -slack * (cy + std::fabs(ex)));
    hits[i] = hit ? t : none;
  }
  for (int i = 0; i < W; ++i)
    if (hits[i] < first && (labels == nullptr || labels[p.triangle[i]] == label)) first = hits[i];
}

double first_of(const HierarchyView& tree, const double* from, const double* to, const std::int32_t* labels,
                std::int32_t label) {
  double way[3], inverse[3];
  for (int k = 0; k < 3; ++k) {
    way[k] = to[k] - from[k];
    inverse[k] = 1.0 / (std::fabs(way[k]) > 1e-200 ? way[k] : std::copysign(1e-200, way[k]));
  }
  double first = none;
  std::int32_t stack[stack_size];
  int pending = 0;
  stack[pending++] = 0;
  while (pending > 0) {
    const WideNode& node = tree.nodes[stack[--pending]];
    alignas(64) double enter[W], leave[W];
    const double end = first < 1.0 ? first : 1.0;
    for (int i = 0; i < W; ++i) enter[i] = 0.0, leave[i] = end;
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < W; ++i) {
        const double low = (static_cast<double>(node.low[k][i]) - slack - from[k]) * inverse[k];
        const double high = (static_cast<double>(node.high[k][i]) + slack - from[k]) * inverse[k];
        const double near = low < high ? low : high, far = low < high ? high : low;
        enter[i] = near > enter[i] ? near : enter[i];
        leave[i] = far < leave[i] ? far : leave[i];
      }
    for (int i = 0; i < node.count; ++i) {
      if (enter[i] > leave[i]) continue;
      if (node.child[i] >= 0)
        stack[pending++] = node.child[i];
      else
        meet(tree.packets[~node.child[i]], from, way, labels, label, first);
    }
  }
  return first;
}

}  // namespace

void first_crossings(const HierarchyView& tree, const double* from, const double* to, std::int64_t count,
                     const std::int32_t* labels, const std::int32_t* own_labels, double* results) {
  for (std::int64_t i = 0; i < count; ++i)
    results[i] = first_of(tree, from + 3 * i, to + 3 * i, labels, labels != nullptr ? own_labels[i] : 0);
}

}  // namespace arapfields::SIMD_LEVEL
