// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "mesh/is_closed.h"

namespace arapfields {

/// body(i) for all i below `count`, in order, on one thread in chunks between which a CancelScope is heard.
template <class Body>
void each_in_order(Index count, const Body& body) {
  constexpr Index rows_at_once = 16384;
  const ThreadScope in_order(1);
  parallel_for(0, count, rows_at_once, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) body(i);
  });
}

/// One triangle's passage along an edge between two positions, from the lower of their vertices to the higher
/// one or back.
struct EdgePassage {
  std::int32_t high, triangle;
  bool upwards;
};

/// The passages of all triangles of a mesh, gathered by edges. Vertices at one position count as one, the
/// first of them.
class EdgePassages {
 public:
  EdgePassages(PointsIn vertices, TrianglesIn triangles) : first_(first_at_position(vertices)) {
    begin_.assign(first_.size() + 1, 0);
    const auto each_passage = [&](auto&& visit) {
      each_in_order(triangles.rows(), [&](Index t) {
        for (int k = 0; k < 3; ++k) {
          const std::int32_t a = first_[triangles(t, k)], b = first_[triangles(t, (k + 1) % 3)];
          if (a != b) visit(std::min(a, b), EdgePassage{std::max(a, b), static_cast<std::int32_t>(t), a < b});
        }
      });
    };
    each_passage([&](std::size_t low, EdgePassage) { ++begin_[low + 1]; });
    for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
    passages_.resize(begin_.back());
    std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
    each_passage([&](std::size_t low, EdgePassage passage) { passages_[next[low]++] = passage; });
    each_in_order(std::ssize(first_), [&](Index low) {
      std::stable_sort(passages_.begin() + begin_[low], passages_.begin() + begin_[low + 1],
                       [](const EdgePassage& a, const EdgePassage& b) { return a.high < b.high; });
    });
  }

  /// For each vertex (n) the first at the same position.
  const std::vector<std::int32_t>& first() const { return first_; }

  /// visit(low, from, to) for each edge: its lower vertex, and its passages in the order of triangles.
  template <class Visit>
  void each_edge(const Visit& visit) const {
    each_in_order(std::ssize(begin_) - 1, [&](Index low) {
      const auto last = passages_.begin() + begin_[low + 1];
      for (auto from = passages_.begin() + begin_[low]; from != last;) {
        const auto to =
            std::find_if(from, last, [&](const EdgePassage& other) { return other.high != from->high; });
        visit(static_cast<std::int32_t>(low), from, to);
        from = to;
      }
    });
  }

 private:
  std::vector<std::int32_t> first_;
  std::vector<std::uint32_t> begin_;  // of the passages of each lower vertex
  std::vector<EdgePassage> passages_;
};

}  // namespace arapfields
