// SPDX-License-Identifier: GPL-3.0-or-later
#if defined(__AVX__)
#include <immintrin.h>
#elif defined(ARAPFIELDS_NEON)
#include <arm_neon.h>
#endif

#include <bit>
#include <cmath>

#include "distance/kernels.h"

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

}  // namespace arapfields::SIMD_LEVEL
