// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// A binary hierarchy of bounding boxes over runs of four rows (n,width). Boxes are tight if rows are in
/// spatial order; updates after a motion take one pass. In single precision.
template <int width>
class RowBoxes {
 public:
  using Row = Eigen::Array<float, width, 1>;
  struct Box {
    Row low = Row::Constant(std::numeric_limits<float>::infinity());
    Row high = -low;

    void add(const Box& other) {
      low = low.min(other.low);
      high = high.max(other.high);
    }
    /// The squared distance of two boxes.
    float gap(const Box& other) const {
      return (low - other.high).max(other.low - high).max(0.0f).square().sum();
    }
    /// Lower bound of the inner products of rows in both boxes.
    float least_product(const Box& other) const {
      const Row a = low * other.low, b = low * other.high, c = high * other.low, d = high * other.high;
      return a.min(b).min(c.min(d)).sum();
    }
  };
  static constexpr Index run = 4;

  /// Of at most `width` columns.
  explicit RowBoxes(const Eigen::Ref<const RowMatrix<double>>& rows) : levels_(1) {
    levels_[0].resize(static_cast<std::size_t>((rows.rows() + run - 1) / run));
    Row row = Row::Zero();
    for (Index i = 0; i < rows.rows(); ++i) {
      for (Index k = 0; k < rows.cols(); ++k) row[k] = static_cast<float>(rows(i, k));
      levels_[0][static_cast<std::size_t>(i / run)].add({row, row});
    }
    while (levels_.back().size() > 1) {
      std::vector<Box> next((levels_.back().size() + 1) / 2);
      for (std::size_t k = 0; k < levels_.back().size(); ++k) next[k / 2].add(levels_.back()[k]);
      levels_.push_back(std::move(next));
    }
  }
  Index levels() const { return std::ssize(levels_); }
  /// Number of boxes of a level; runs are level 0.
  Index count(Index level = 0) const { return std::ssize(levels_[static_cast<std::size_t>(level)]); }
  const Box& box(Index level, Index k) const {
    return levels_[static_cast<std::size_t>(level)][static_cast<std::size_t>(k)];
  }

 private:
  std::vector<std::vector<Box>> levels_;
};

}  // namespace arapfields
