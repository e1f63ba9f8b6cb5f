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

/// The Jacobian at a point, from jets of at least first order.
template <class Scalar>
Mat3 jacobian_at(JetView<const Scalar> jets, Index point) {
  Mat3 j;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i) j(i, k) = static_cast<double>(jets.at(first_column(k), point)[i]);
  return j;
}

/// det(J) J⁻ᵀ, also where J has no inverse.
inline Mat3 cofactors(const Mat3& j) {
  Mat3 c;
  for (int k = 0; k < 3; ++k) {
    const Vec3 a = j.col((k + 1) % 3), b = j.col((k + 2) % 3);
    c.col(k) << a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0];
  }
  return c;
}

/// The normal of a moved surface, as long as the factor by which its area grows.
inline Vec3 area_vector(const Mat3& jacobian, const Vec3& normal) {
  const Mat3 c = cofactors(jacobian);
  return normal[0] * c.col(0) + normal[1] * c.col(1) + normal[2] * c.col(2);
}

/// The product rule: p becomes the jet of a·p, up to second derivatives. a(c) and p(c) are the columns of the
/// factor's jet and of one component.
template <class Factor, class Component>
void multiply_jet(const Factor& a, const Component& p) {
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const int cj = first_column(j), ck = first_column(k), cjk = second_column(j, k);
      p(cjk) = a(0) * p(cjk) + a(cj) * p(ck) + a(ck) * p(cj) + a(cjk) * p(0);
    }
  for (int c = 1; c < 4; ++c) p(c) = a(0) * p(c) + a(c) * p(0);
  p(0) *= a(0);
}

}  // namespace arapfields
