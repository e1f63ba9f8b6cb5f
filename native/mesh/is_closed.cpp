// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/is_closed.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "core/parallel.h"
#include "mesh/edge_passages.h"

namespace arapfields {
namespace {

constexpr Index vertices_at_once = 16384;

std::uint64_t mixed(std::uint64_t x) {
  x *= 0x9e3779b97f4a7c15ULL;
  return x ^ (x >> 29);
}

}  // namespace

/// By an open-addressing hash table, on one thread in chunks, between which a CancelScope is heard.
std::vector<std::int32_t> first_at_position(PointsIn vertices) {
  const auto count = static_cast<std::size_t>(vertices.rows());
  const std::size_t size = std::bit_ceil(2 * count + 1);
  std::vector<std::int32_t> table(size, -1), first(count);
  const ThreadScope in_order(1);
  parallel_for(0, vertices.rows(), vertices_at_once, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 p = vertices.row(i).transpose() + Vec3::Zero();  // −0 becomes 0
      std::uint64_t hash = 0;
      for (int k = 0; k < 3; ++k) hash = mixed(hash ^ std::bit_cast<std::uint64_t>(p[k]));
      std::size_t slot = hash & (size - 1);
      while (table[slot] >= 0 && vertices.row(table[slot]) != p.transpose()) slot = (slot + 1) & (size - 1);
      if (table[slot] < 0) table[slot] = static_cast<std::int32_t>(i);
      first[i] = table[slot];
    }
  });
  return first;
}

bool is_closed(PointsIn vertices, TrianglesIn triangles) {
  bool closed = true;
  EdgePassages(vertices, triangles).each_edge([&](std::int32_t, auto from, auto to) {
    const auto upwards = std::count_if(from, to, [](const EdgePassage& passage) { return passage.upwards; });
    closed &= 2 * upwards == to - from;
  });
  return closed;
}

}  // namespace arapfields
