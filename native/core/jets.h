// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"

namespace arapfields {

/// How many columns a jet has: value; value and ∂_1..∂_3; these and ∂_11, ∂_22, ∂_33, ∂_12, ∂_13, ∂_23.
enum class JetOrder : int { value = 1, first = 4, second = 10 };

constexpr int columns(JetOrder order) { return static_cast<int>(order); }
/// Column of ∂_k (k = 0..2).
constexpr int first_column(int k) { return 1 + k; }
/// Column of ∂_jk (j, k = 0..2).
constexpr int second_column(int j, int k) {
  constexpr int table[3][3] = {{4, 7, 8}, {7, 5, 9}, {8, 9, 6}};
  return table[j][k];
}

/// Jets of a map R³ → R³ at `count` points, or cotangents of such jets, as one contiguous block
/// (columns, count, 3): column c of point p has the three components data[(c·count + p)·3 + 0..2].
/// J_ik = (column 1+k)_i and D_k[i][j] = ∂²f_i/∂x_j∂x_k = (column second_column(j,k))_i.
/// The cotangent of a mixed column is the derivative by that one number: it collects jk and kj.
template <class Scalar>
struct JetView {
  Scalar* data = nullptr;
  Index count = 0;
  JetOrder order = JetOrder::value;

  Scalar* column(int c) const { return data + static_cast<Index>(c) * count * 3; }
  Scalar* at(int c, Index point) const { return column(c) + point * 3; }
  Index size() const { return columns(order) * count * 3; }
  operator JetView<const Scalar>() const { return {data, count, order}; }
};

/// A JetView that owns its memory, zero at the start.
template <class Scalar>
class JetBlock {
 public:
  JetBlock(Index count, JetOrder order)
      : memory_(static_cast<std::size_t>(columns(order) * count * 3)), count_(count), order_(order) {}
  JetView<Scalar> view() { return {memory_.data(), count_, order_}; }
  JetView<const Scalar> view() const { return {memory_.data(), count_, order_}; }

 private:
  std::vector<Scalar> memory_;
  Index count_;
  JetOrder order_;
};

}  // namespace arapfields
