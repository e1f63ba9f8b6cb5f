// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/blend.h"

#include "core/jets.h"

namespace arapfields {
namespace {

constexpr int all = columns(JetOrder::second);

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace

template <class Scalar>
RadialBlend<Scalar>::RadialBlend(const HandleBlend& blend, PointsIn samples) {
  const Index n = samples.rows();
  Vector free(all * n);
  blend.free_weight(samples, JetOrder::second, free.data());
  JetBlock<double> moved(n, JetOrder::second);
  blend.evaluate(samples, moved.view());
  for (Index p = 0; p < n; ++p) {
    if (free[p] == 1.0) continue;  // a = 1 has zero derivatives: outside all margins
    rows_.push_back(p);
    for (int c = 0; c < all; ++c) free_.push_back(static_cast<Scalar>(free[c * n + p]));
    for (int c = 0; c < all; ++c)
      for (int i = 0; i < 3; ++i) {
        double product = free[c * n + p] * samples(p, i);  // jet of a·x_i
        if (c >= 1 && c <= 3) product += c == first_column(i) ? free[p] : 0.0;
        for (int j = 0; j < 3 && c > 3; ++j)
          if (second_column(i, j) == c) product += (i == j ? 2.0 : 1.0) * free[first_column(j) * n + p];
        fixed_.push_back(static_cast<Scalar>(moved.view().at(c, p)[i] - product));
      }
  }
}

template <class Scalar>
void RadialBlend<Scalar>::multiply(JetView<Scalar> jets) const {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const auto a = [&](int c) { return free_[all * r + static_cast<std::size_t>(c)]; };
    for (int i = 0; i < 3; ++i) multiply_jet(a, [&](int c) -> Scalar& { return jets.at(c, rows_[r])[i]; });
  }
}

template <class Scalar>
void RadialBlend<Scalar>::multiply_transposed(JetView<Scalar> cotangents) const {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Scalar* a = &free_[all * r];
    for (int i = 0; i < 3; ++i) {
      const auto p = [&](int c) -> Scalar& { return cotangents.at(c, rows_[r])[i]; };
      p(0) *= a[0];
      for (int c = 1; c < all; ++c) p(0) += a[c] * p(c);
      for (int c = 1; c < 4; ++c) p(c) *= a[0];
      for (int j = 0; j < 3; ++j)
        for (int k = j; k < 3; ++k) {
          const int cj = first_column(j), ck = first_column(k), cjk = second_column(j, k);
          p(ck) += a[cj] * p(cjk);
          p(cj) += a[ck] * p(cjk);
        }
      for (int c = 4; c < all; ++c) p(c) *= a[0];
    }
  }
}

template <class Scalar>
void RadialBlend<Scalar>::add_fixed(JetView<Scalar> jets) const {
  for (std::size_t r = 0; r < rows_.size(); ++r)
    for (int c = 0; c < all; ++c)
      for (int i = 0; i < 3; ++i)
        jets.at(c, rows_[r])[i] += fixed_[at(3 * (all * static_cast<Index>(r) + c) + i)];
}

template class RadialBlend<float>;
template class RadialBlend<double>;

}  // namespace arapfields
