// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/kernels.h"

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(ARAPFIELDS_NEON)
#include <arm_neon.h>
#endif

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int W = tree_width;

/// Updates `best` with a packet's triangles. Never inlined: rounding must be the same for all callers.
__attribute__((noinline)) void visit(const TrianglePacket& t, std::int32_t index, const double* p,
                                     Nearest& best) {
  alignas(64) double squared[W];
  for (int i = 0; i < W; ++i) {
    const double dx = p[0] - t.origin[0][i], dy = p[1] - t.origin[1][i], dz = p[2] - t.origin[2][i];
    const double x = dx * t.axis_x[0][i] + dy * t.axis_x[1][i] + dz * t.axis_x[2][i];
    const double y = dx * t.axis_y[0][i] + dy * t.axis_y[1][i] + dz * t.axis_y[2][i];
    const double z = dx * t.axis_z[0][i] + dy * t.axis_z[1][i] + dz * t.axis_z[2][i];
    const double bx = t.bx[i], cx = t.cx[i], cy = t.cy[i], ex = cx - bx, xb = x - bx;
    // Nearest point of each side, by its parameter along the side.
    double ab = x < bx ? x : bx;
    ab = ab > 0.0 ? ab : 0.0;
    double ac = (x * cx + y * cy) * t.inverse_ac[i];
    ac = ac < 1.0 ? ac : 1.0;
    ac = ac > 0.0 ? ac : 0.0;
    double bc = (xb * ex + y * cy) * t.inverse_bc[i];
    bc = bc < 1.0 ? bc : 1.0;
    bc = bc > 0.0 ? bc : 0.0;
    const double ab_x = x - ab, ac_x = x - ac * cx, ac_y = y - ac * cy;
    const double bc_x = xb - bc * ex, bc_y = y - bc * cy;
    const double to_ab = ab_x * ab_x + y * y, to_ac = ac_x * ac_x + ac_y * ac_y;
    const double to_bc = bc_x * bc_x + bc_y * bc_y;
    double in_plane = to_ab < to_ac ? to_ab : to_ac;
    in_plane = in_plane < to_bc ? in_plane : to_bc;
    const bool inside = (y > 0.0) & (x * cy - y * cx > 0.0) & (y * ex - xb * cy > 0.0);
    squared[i] = z * z + (inside ? 0.0 : in_plane);
  }
  int closer = 0;
  for (int i = 0; i < W; ++i) closer |= squared[i] <= best.squared_distance ? 1 : 0;
  if (closer == 0) return;
  for (int i = 0; i < W; ++i) {
    const bool first = squared[i] == best.squared_distance && t.triangle[i] < best.triangle;
    if (squared[i] < best.squared_distance || first) best = {squared[i], t.triangle[i], index};
  }
}

/// A query point in single precision: an interval that contains the exact one, and the absolute rounding
/// error of distances to disks.
struct Query {
  float low[3], high[3], middle[3];
  float slack;
};

Query rounded(const double* p) {
  Query result;
  result.slack = 3e-6f;
  for (int k = 0; k < 3; ++k) {
    const float x = static_cast<float>(p[k]), half = std::fabs(x) * 1.3e-7f + 1e-38f;
    result.low[k] = x - half;
    result.high[k] = x + half;
    result.middle[k] = x;
    result.slack += std::fabs(x) * 1e-6f;
  }
  return result;
}

/// Children whose lower bound (bounds_from_below) exceeds this cannot contain a nearer triangle.
float limit_of(const Nearest& best) { return static_cast<float>(best.squared_distance) * 1.000002f + 1e-37f; }

/// For each child a lower bound of the squared distance: that to its box or to its disk, whichever is larger.
inline void bounds_from_below(const WideNode& node, const Query& p, float* squared) {
  for (int i = 0; i < W; ++i) {
    float to_box = 0.0f;
    for (int k = 0; k < 3; ++k) {
      const float below = node.low[k][i] - p.high[k], above = p.low[k] - node.high[k][i];
      float d = below > above ? below : above;
      d = d > 0.0f ? d : 0.0f;
      to_box += d * d;
    }
    const float dx = p.middle[0] - node.disk_center[0][i], dy = p.middle[1] - node.disk_center[1][i];
    const float dz = p.middle[2] - node.disk_center[2][i];
    const float along =
        dx * node.disk_normal[0][i] + dy * node.disk_normal[1][i] + dz * node.disk_normal[2][i];
    const float length = dx * dx + dy * dy + dz * dz;
    const float across = length * 0.999998f - along * along;
    float above = std::fabs(along) - (node.disk_height[i] + p.slack);
    float beside = std::sqrt(across > 0.0f ? across : 0.0f) - (node.disk_radius[i] + p.slack);
    above = above > 0.0f ? above : 0.0f;
    beside = beside > 0.0f ? beside : 0.0f;
    const float to_disk = above * above + beside * beside;
    squared[i] = to_box > to_disk ? to_box : to_disk;
  }
}

/// Bit i: values[i] ≤ limit.
inline unsigned at_most(const float* values, float limit) {
#if defined(__AVX__)
  const __m256 v = _mm256_loadu_ps(values);
  return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(v, _mm256_set1_ps(limit), _CMP_LE_OQ)));
#elif defined(ARAPFIELDS_NEON)
  static_assert(W == 8, "two vectors of floats");
  constexpr std::uint32_t low[4] = {1, 2, 4, 8}, high[4] = {16, 32, 64, 128};
  const float32x4_t most = vdupq_n_f32(limit);
  const uint32x4_t first = vandq_u32(vcleq_f32(vld1q_f32(values), most), vld1q_u32(low));
  const uint32x4_t second = vandq_u32(vcleq_f32(vld1q_f32(values + 4), most), vld1q_u32(high));
  return vaddvq_u32(vorrq_u32(first, second));
#else
  unsigned mask = 0;
  for (int i = 0; i < W; ++i) mask |= values[i] <= limit ? 1u << i : 0u;
  return mask;
#endif
}

/// The children left to visit, the nearest on top. An entry has the bits of the child's lower bound in its
/// upper half, by which entries sort, and the child in its lower half.
struct Stack {
  std::uint64_t entries[stack_size];
  std::uint64_t* top = entries;

  bool empty() const { return top == entries; }
  std::int32_t top_child() const { return static_cast<std::int32_t>(static_cast<std::uint32_t>(top[-1])); }
  float top_bound() const { return std::bit_cast<float>(static_cast<std::uint32_t>(top[-1] >> 32)); }
  /// Adds a node's children within the limit, sorted among themselves.
  void push(const WideNode& node, const float* squared, float limit) {
    const std::uint64_t* const floor = top;
    for (unsigned hits = at_most(squared, limit) & ((1u << node.count) - 1u); hits != 0; hits &= hits - 1) {
      const int i = std::countr_zero(hits);
      const std::uint64_t bits = std::bit_cast<std::uint32_t>(squared[i]);
      const std::uint64_t entry = bits << 32 | static_cast<std::uint32_t>(node.child[i]);
      std::uint64_t* place = top++;
      for (; place != floor && place[-1] < entry; --place) *place = place[-1];
      *place = entry;
    }
  }
};

void search(const HierarchyView& tree, const double* p, Nearest& best) {
  const Query query = rounded(p);
  const std::int32_t seen = best.packet;
  float limit = limit_of(best);
  Stack stack;
  *stack.top++ = 0;  // the root, at no distance
  while (!stack.empty()) {
    const std::int32_t child = stack.top_child();
    const bool near = stack.top_bound() <= limit;
    --stack.top;
    if (!near) continue;
    if (child < 0) {
      if (~child == seen) continue;
      visit(tree.packets[~child], ~child, p, best);
      limit = limit_of(best);
      continue;
    }
    alignas(64) float first[W], second[W];
    bounds_from_below(tree.nodes[child], query, first);
    // The next node is likely to be visited as well; processing both hides memory latency.
    if (!stack.empty() && stack.top_child() >= 0) {
      const std::int32_t other = stack.top_child();
      --stack.top;
      bounds_from_below(tree.nodes[other], query, second);
      stack.push(tree.nodes[other], second, limit);
    }
    stack.push(tree.nodes[child], first, limit);
  }
}

constexpr Nearest nothing = {INFINITY, INT32_MAX, -1};

}  // namespace

void nearest(const HierarchyView& tree, const double* points, std::int64_t count, Nearest* results) {
  std::int32_t likely = 0;  // the previous point's packet: its distance is a good first bound
  for (std::int64_t i = 0; i < count; ++i) {
    Nearest best = nothing;
    visit(tree.packets[likely], likely, points + 3 * i, best);
    search(tree, points + 3 * i, best);
    results[i] = best;
    likely = best.packet;
  }
}

void nearest_of_all(const HierarchyView& tree, const double* points, std::int64_t count, Nearest* results) {
  for (std::int64_t i = 0; i < count; ++i) {
    results[i] = nothing;
    for (std::int32_t k = 0; k < tree.packet_count; ++k)
      visit(tree.packets[k], k, points + 3 * i, results[i]);
  }
}

void overlapping(const double* points, const Nearest* nearest, int count, std::uint64_t* links) {
  alignas(64) double x[3][linked_points], radius[linked_points];
  alignas(64) std::uint64_t bit[linked_points];
  for (int i = 0; i < linked_points; ++i) {
    for (int k = 0; k < 3; ++k) x[k][i] = i < count ? points[3 * i + k] : 0.0;
    // Shrunk, so that disjoint balls do not overlap by rounding.
    radius[i] = i < count ? std::sqrt(nearest[i].squared_distance) * (1.0 - 1e-9) : 0.0;
    bit[i] = i < count ? std::uint64_t{1} << i : 0;
  }
  for (int i = 0; i < count; ++i) {
    std::uint64_t mask = 0;
    for (int j = 0; j < linked_points; ++j) {
      const double dx = x[0][i] - x[0][j], dy = x[1][i] - x[1][j], dz = x[2][i] - x[2][j];
      const double sum_of_radii = radius[i] + radius[j];
      mask |= dx * dx + dy * dy + dz * dz < sum_of_radii * sum_of_radii ? bit[j] : 0;
    }
    links[i] = mask;
  }
}

namespace {

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

namespace {

constexpr double pi = std::numbers::pi;

/// atan2(y, x) to 1e-15. On [0, tan(π/8)] a minimax polynomial of atan(t)/t in t². Selections are factors 0
/// and 1: compilers turn conditions into branches, and then do not vectorise.
inline double arc_tangent(double y, double x) {
  const double ax = std::fabs(x), ay = std::fabs(y);
  const double swap = ax < ay ? 1.0 : 0.0, back = x < 0.0 ? 1.0 : 0.0;
  const double small = ax < ay ? ax : ay, large = ax < ay ? ay : ax;
  // Above tan(π/8): atan(t) = π/4 + atan((t − 1)/(t + 1)).
  const double steep = small > 0.41421356237309503 * large ? 1.0 : 0.0;
  const double t = (small - steep * large) / (large + steep * small + 1e-300);
  const double u = t * t;
  double p = -0.0253164795737764757;
  p = p * u + 0.0502476211894012803;
  p = p * u - 0.0650598296717083992;
  p = p * u + 0.0767353542818328602;
  p = p * u - 0.0908952995656230736;
  p = p * u + 0.111110488537512957;
  p = p * u - 0.142857126616847938;
  p = p * u + 0.199999999783926621;
  p = p * u - 0.33333333333221434;
  p = p * u + 0.999999999999999041;
  double angle = t * p + steep * (0.25 * pi);
  angle = swap * (0.5 * pi) + (1.0 - 2.0 * swap) * angle;
  angle = back * pi + (1.0 - 2.0 * back) * angle;
  return std::copysign(angle, y);
}

/// Adds each triangle's half solid angle seen from p (Van Oosterom and Strackee 1983), in its own plane's
/// coordinates, where the triple product is −z · bx · cy. Zero in that plane.
inline void add_half_angles(const TrianglePacket& t, const double* p, double* sums) {
  for (int i = 0; i < W; ++i) {
    const double dx = p[0] - t.origin[0][i], dy = p[1] - t.origin[1][i], dz = p[2] - t.origin[2][i];
    const double x = dx * t.axis_x[0][i] + dy * t.axis_x[1][i] + dz * t.axis_x[2][i];
    const double y = dx * t.axis_y[0][i] + dy * t.axis_y[1][i] + dz * t.axis_y[2][i];
    const double z = dx * t.axis_z[0][i] + dy * t.axis_z[1][i] + dz * t.axis_z[2][i];
    const double zz = z * z, xb = t.bx[i] - x, xc = t.cx[i] - x, yc = t.cy[i] - y;
    const double a = std::sqrt(x * x + y * y + zz), b = std::sqrt(xb * xb + y * y + zz);
    const double c = std::sqrt(xc * xc + yc * yc + zz);
    const double ab = y * y + zz - x * xb, bc = xb * xc - y * yc + zz, ca = zz - x * xc - y * yc;
    const double triple = -z * t.bx[i] * t.cy[i], sum = a * b * c + ab * c + bc * a + ca * b;
    sums[i] += (triple != 0.0 ? 1.0 : 0.0) * arc_tangent(triple, sum);
  }
}

/// Adds the multipole field of every child that is far enough, and its remainder; marks those children.
inline void add_far_fields(const NodeMoments& m, const float* q, float opening_squared, double* sums,
                           float* remainders, std::int32_t* is_far) {
  for (int i = 0; i < W; ++i) {
    const float rx = m.center[0][i] - q[0], ry = m.center[1][i] - q[1], rz = m.center[2][i] - q[2];
    const float squared = rx * rx + ry * ry + rz * rz;
    const float inverse = 1.0f / std::sqrt(squared + 1e-30f);
    const float x = rx * inverse, y = ry * inverse, z = rz * inverse;
    const float xx = x * x, yy = y * y, zz = z * z;
    const float dipole = m.dipole[0][i] * x + m.dipole[1][i] * y + m.dipole[2][i] * z;
    const float quadrupole = m.quadrupole[0][i] * (xx - zz) + m.quadrupole[1][i] * (yy - zz) +
                             m.quadrupole[2][i] * x * y + m.quadrupole[3][i] * x * z +
                             m.quadrupole[4][i] * y * z;
    const float octupole = m.octupole[0][i] * x * (xx - 3.0f * zz) + m.octupole[1][i] * y * (yy - 3.0f * zz) +
                           m.octupole[2][i] * y * (xx - zz) + m.octupole[3][i] * x * (yy - zz) +
                           m.octupole[4][i] * z * (3.0f * xx - zz) + m.octupole[5][i] * z * (3.0f * yy - zz) +
                           m.octupole[6][i] * x * y * z;
    const float field = ((octupole * inverse + quadrupole) * inverse + dipole) * inverse * inverse;
    const bool far = squared > opening_squared * m.radius_squared[i];
    const float spread = m.radius_squared[i] * inverse * inverse;
    const float remainder = m.area[i] * inverse * inverse * spread * spread;
    sums[i] += static_cast<double>(far ? field : 0.0f);
    remainders[i] += far ? remainder : 0.0f;
    is_far[i] = far ? 1 : 0;
  }
}

struct Winding {
  double number = 0.0, remainder = 0.0;
};

Winding winding_at(const HierarchyView& tree, const double* p, float opening_squared) {
  const float q[3] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  alignas(64) double fields[W] = {}, half_angles[W] = {};
  alignas(64) float remainders[W] = {};
  std::int32_t stack[stack_size];
  std::int32_t* top = stack;
  *top++ = 0;
  while (top != stack) {
    const std::int32_t index = *--top;
    if (index < 0) {
      add_half_angles(tree.packets[~index], p, half_angles);
      continue;
    }
    alignas(64) std::int32_t is_far[W];
    add_far_fields(tree.moments[index], q, opening_squared, fields, remainders, is_far);
    const WideNode& node = tree.nodes[index];
    for (int i = 0; i < node.count; ++i)
      if (is_far[i] == 0) *top++ = node.child[i];
  }
  Winding result;
  for (int i = 0; i < W; ++i) {
    result.number += fields[i] + half_angles[i] / (2.0 * pi);
    result.remainder += static_cast<double>(remainders[i]);
  }
  return result;
}

}  // namespace

void winding(const HierarchyView& tree, const double* points, std::int64_t count, double opening,
             double* numbers, double* remainders) {
  const float opening_squared = static_cast<float>(opening * opening);
  for (std::int64_t i = 0; i < count; ++i) {
    const double* p = points + 3 * i;
    // So far away the mesh is a speck, and single precision would overflow.
    const bool remote = std::fabs(p[0]) > 1e9 || std::fabs(p[1]) > 1e9 || std::fabs(p[2]) > 1e9;
    const Winding result = remote ? Winding{} : winding_at(tree, p, opening_squared);
    numbers[i] = result.number;
    if (remainders != nullptr) remainders[i] = result.remainder;
  }
}

}  // namespace arapfields::SIMD_LEVEL
