// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// Points in the cells of a grid, made anew where they move: cheaper than a tree that is asked once.
class PointGrid {
 public:
  /// Of finite points (n,3), for searches within `reach`, which is a cell's least edge.
  PointGrid(PointsIn points, double reach);
  /// Cells that hold points, and those of each.
  Index size() const { return static_cast<Index>(cells_.size()); }
  std::span<const Index> rows(Index cell) const { return rows_of(cells_[static_cast<std::size_t>(cell)]); }
  /// The cell of each point (n).
  std::vector<Index> cell_of_each() const {
    std::vector<Index> cells(rows_.size());
    for (Index c = 0; c < size(); ++c)
      for (const Index row : rows(c)) cells[static_cast<std::size_t>(row)] = c;
    return cells;
  }
  /// Calls visit(cell) for the cells, of those that hold points, that touch this one, and itself.
  template <class Visit>
  void near(Index cell, Visit&& visit) const {
    const Index at = cells_[static_cast<std::size_t>(cell)];
    const Index z = at % counts_[2];
    const Index y = at / counts_[2] % counts_[1];
    const Index x = at / (counts_[2] * counts_[1]);
    for (Index i = std::max<Index>(x - 1, 0); i <= std::min<Index>(x + 1, counts_[0] - 1); ++i)
      for (Index j = std::max<Index>(y - 1, 0); j <= std::min<Index>(y + 1, counts_[1] - 1); ++j)
        for (Index k = std::max<Index>(z - 1, 0); k <= std::min<Index>(z + 1, counts_[2] - 1); ++k) {
          const Index number = numbers_[static_cast<std::size_t>((i * counts_[1] + j) * counts_[2] + k)];
          if (number >= 0) visit(number);
        }
  }

 private:
  static constexpr int most_cells_a_side = 96;
  std::span<const Index> rows_of(Index at) const {
    const auto first = static_cast<std::size_t>(start_[static_cast<std::size_t>(at)]);
    return {rows_.data() + first, static_cast<std::size_t>(start_[static_cast<std::size_t>(at) + 1]) - first};
  }

  Eigen::Array3i counts_ = Eigen::Array3i::Ones();
  std::vector<Index> start_;    // of each place of the grid in rows_, and the end
  std::vector<Index> numbers_;  // of the cell at each place; −1: none
  std::vector<Index> cells_;    // places that hold points
  std::vector<Index> rows_;
};

}  // namespace arapfields
