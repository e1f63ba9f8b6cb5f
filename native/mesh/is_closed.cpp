// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/is_closed.h"

#include <algorithm>
#include <array>
#include <bit>
#include <vector>

#include "core/parallel.h"

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
  const std::vector<std::int32_t> first = first_at_position(vertices);
  // Passages of undirected edges, +1 upwards and −1 downwards, gathered by the edge's lower vertex.
  struct Passage {
    std::int32_t high, direction;
  };
  std::vector<std::uint32_t> begin(vertices.rows() + 1, 0);
  const auto each_edge = [&](auto&& visit) {
    for (Index t = 0; t < triangles.rows(); ++t)
      for (int k = 0; k < 3; ++k) {
        const std::int32_t a = first[triangles(t, k)];
        const std::int32_t b = first[triangles(t, (k + 1) % 3)];
        if (a != b) visit(std::min(a, b), Passage{std::max(a, b), a < b ? 1 : -1});
      }
  };
  each_edge([&](std::size_t low, Passage) { ++begin[low + 1]; });
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  std::vector<Passage> passages(begin.back());
  std::vector<std::uint32_t> next(begin.begin(), begin.end() - 1);
  each_edge([&](std::size_t low, Passage passage) { passages[next[low]++] = passage; });
  for (std::size_t i = 0; i + 1 < begin.size(); ++i) {
    const auto from = passages.begin() + begin[i], to = passages.begin() + begin[i + 1];
    std::sort(from, to, [](const Passage& a, const Passage& b) { return a.high < b.high; });
    for (auto p = from; p != to;) {
      std::int64_t sum = 0;
      const std::int32_t high = p->high;
      for (; p != to && p->high == high; ++p) sum += p->direction;
      if (sum != 0) return false;
    }
  }
  return true;
}

}  // namespace arapfields
