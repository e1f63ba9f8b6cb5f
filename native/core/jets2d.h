// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// (n,2), one point of the plane a row.
using Points2 = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
using Points2In = const Eigen::Ref<const Points2>&;
using Vec2 = Eigen::Vector2d;
using Mat2 = Eigen::Matrix2d;

/// Columns of a plane jet: value, ∂_1, ∂_2, ∂_11, ∂_22, ∂_12.
constexpr int columns2 = 6;
/// Column of ∂_jk (j, k = 0..1).
constexpr int second_column2(int j, int k) { return j == k ? 3 + j : 5; }

/// Second-order jets of a map R² → R² at `count` points, or cotangents of such jets, as one block
/// (6, count, 2); the plane's counterpart of JetView.
template <class Scalar>
struct JetView2 {
  Scalar* data = nullptr;
  Index count = 0;

  Scalar* at(int column, Index point) const { return data + (column * count + point) * 2; }
  Index size() const { return columns2 * count * 2; }
  operator JetView2<const Scalar>() const { return {data, count}; }
};

}  // namespace arapfields
