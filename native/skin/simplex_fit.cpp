// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/simplex_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <vector>

#include "core/decompositions.h"

namespace arapfields {
namespace {

/// Penalty weight of the constraint Σ w = 1, relative to H's mean diagonal.
constexpr double sum_weight = 10.0;

/// argmin of wᵀHw/2 − gᵀw over w ≥ 0 (Lawson, Hanson 1974, chapter 23, on the normal equations).
FewBones non_negative(const BonePairs& h, const FewBones& g) {
  const Index n = g.size();
  FewBones w = FewBones::Zero(n);
  std::vector<Index> free;
  const auto solve_free = [&] {
    BonePairs part(free.size(), free.size());
    FewBones right(free.size());
    for (std::size_t i = 0; i < free.size(); ++i) {
      right[i] = g[free[i]];
      for (std::size_t j = 0; j < free.size(); ++j) part(i, j) = h(free[i], free[j]);
    }
    return FewBones(part.ldlt().solve(right));
  };
  for (Index round = 0; round < 3 * n; ++round) {
    const FewBones dual = g - h * w;
    Index entering = -1;
    for (Index i = 0; i < n; ++i)
      if (std::ranges::find(free, i) == free.end() &&
          dual[i] > 1e-10 * std::max(1.0, g.cwiseAbs().maxCoeff()) &&
          (entering < 0 || dual[i] > dual[entering]))
        entering = i;
    if (entering < 0) break;
    free.push_back(entering);
    while (!free.empty()) {
      const FewBones next = solve_free();
      double step = 1.0;
      for (std::size_t i = 0; i < free.size(); ++i)
        if (next[i] <= 0.0) step = std::min(step, w[free[i]] / std::max(w[free[i]] - next[i], 1e-300));
      for (std::size_t i = 0; i < free.size(); ++i) w[free[i]] += step * (next[i] - w[free[i]]);
      if (step >= 1.0) break;
      std::erase_if(free, [&](Index i) {
        if (w[i] > 1e-12) return false;
        w[i] = 0.0;
        return true;
      });
    }
  }
  return w;
}

std::vector<Index> positive(const FewBones& w) {
  std::vector<Index> result;
  for (Index i = 0; i < w.size(); ++i)
    if (w[i] > 0.0) result.push_back(i);
  return result;
}

/// The used weight whose removal increases the objective least, w_j² / (H⁻¹)_jj, with the others adapted
/// (Hassibi, Stork 1993).
Index cheapest(const BonePairs& h, const FewBones& w, const std::vector<Index>& used) {
  Eigen::MatrixXd part = h(used, used);
  part.diagonal().array() *= 1.0 + 1e-12;
  const auto n = static_cast<Index>(used.size());
  const Eigen::MatrixXd inverse = solve_definite(part, Eigen::MatrixXd::Identity(n, n));
  Index best = used.front();
  double least = std::numeric_limits<double>::infinity();
  for (Index j = 0; j < n; ++j) {
    const double loss = w[used[j]] * w[used[j]] / std::max(inverse(j, j), 1e-300);
    if (loss < least) least = loss, best = used[j];
  }
  return best;
}

}  // namespace

FewBones simplex_minimum(const BonePairs& h, const FewBones& g, int influences) {
  const Index k = g.size();
  if (k == 1) return FewBones::Ones(1);
  const double scale = sum_weight * h.diagonal().mean();
  BonePairs square = (h.array() + scale) / scale;
  FewBones right = (g.array() + scale) / scale;
  FewBones w = non_negative(square, right);
  for (;;) {
    const std::vector<Index> used = positive(w);
    if (static_cast<int>(used.size()) <= influences) break;
    const Index leaving = cheapest(square, w, used);  // fixed at 0 from now on
    square.row(leaving).setZero();
    square.col(leaving).setZero();
    square(leaving, leaving) = 1.0;
    right[leaving] = 0.0;
    w = non_negative(square, right);
  }
  return w / w.sum();
}

}  // namespace arapfields
