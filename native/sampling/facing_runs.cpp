// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/facing_runs.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Relative tolerance of squared distances in single precision.
constexpr float rounding = 1e-4f;
/// Coordinate of samples that are not open.
constexpr float nowhere = 1e15f;

}  // namespace

FacingRuns::FacingRuns(RowMatrix<double> rest, double far)
    : far_((1.0f - rounding) * static_cast<float>(far * far)) {
  order_.resize(static_cast<std::size_t>(rest.rows()));
  std::iota(order_.begin(), order_.end(), 0);
  const auto split = [&](const auto& self, Index first, Index last) -> void {
    Index half = run;
    if (last - first <= half) return;
    while (2 * half < last - first) half *= 2;
    const std::vector<Index> members(order_.begin() + first, order_.begin() + last);
    const RowMatrix<double> rows = rest(members, Eigen::all);
    Index longest = 0;
    (rows.colwise().maxCoeff() - rows.colwise().minCoeff()).maxCoeff(&longest);
    std::nth_element(
        order_.begin() + first, order_.begin() + first + half, order_.begin() + last,
        [&](Index i, Index j) { return std::pair(rest(i, longest), i) < std::pair(rest(j, longest), j); });
    self(self, first, first + half);
    self(self, first + half, last);
  };
  split(split, 0, rest.rows());
  rest = rest(order_, Eigen::all).eval();
  const RowBoxes<8> boxes(rest);
  for (Index level = 0; level < boxes.levels(); ++level) {
    std::vector<Ball>& balls = balls_.emplace_back(static_cast<std::size_t>(boxes.count(level)));
    const Index rows = run << level;
    for (Index k = 0; k < std::ssize(balls); ++k) {
      Ball& ball = balls[static_cast<std::size_t>(k)];
      ball.middle = 0.5f * (boxes.box(level, k).low + boxes.box(level, k).high);
      const auto members = rest.middleRows(k * rows, std::min(rows, rest.rows() - k * rows));
      const Eigen::RowVectorXd middle = ball.middle.matrix().transpose().cast<double>();
      const double radius = std::sqrt((members.rowwise() - middle).rowwise().squaredNorm().maxCoeff());
      ball.left = static_cast<float>(0.5 * (1.0 - rounding) * far - radius);
    }
  }
  rest_.resize(static_cast<std::size_t>(count()));
  for (Index i = 0; i < rest.rows(); ++i)
    for (Index c = 0; c < rest.cols(); ++c)
      rest_[static_cast<std::size_t>(i / run)].at[c][i % run] = static_cast<float>(rest(i, c));
}

bool FacingRuns::meet(const Rest& rest_a, const Rest& rest_b, const Now& a, const Now& b,
                      const Limits& limits) {
  for (Index i = 0; i < run; ++i) {
    if (a.at[0][i] == nowhere) continue;
    const Lanes square =
        (b.at[0] - a.at[0][i]).square() + (b.at[1] - a.at[1][i]).square() + (b.at[2] - a.at[2][i]).square();
    if (square.minCoeff() >= limits.near) continue;
    const Lanes cosine =
        b.normal[0] * a.normal[0][i] + b.normal[1] * a.normal[1][i] + b.normal[2] * a.normal[2][i];
    Lanes apart = Lanes::Zero();
    for (std::size_t c = 0; c < 8; ++c) apart += (rest_b.at[c] - rest_a.at[c][i]).square();
    if ((square - limits.near).max(cosine - limits.facing).max(limits.far - apart).minCoeff() < 0.0f)
      return true;
  }
  return false;
}

std::vector<std::vector<Index>> FacingRuns::meeting(PointsIn places, const Points& normals,
                                                    const Eigen::Array<bool, Eigen::Dynamic, 1>& open,
                                                    double near, double facing) const {
  const RowBoxes<4> boxes(rows_of(places, order_));
  const bool known = normals.rows() > 0;
  const RowBoxes<4> sides(known ? rows_of(normals, order_) : Points(0, 3));
  Now none;
  for (Lanes& lanes : none.at) lanes = Lanes::Constant(nowhere);
  for (Lanes& lanes : none.normal) lanes = Lanes::Zero();
  std::vector<Now> now(static_cast<std::size_t>(count()), none);
  for (Index k = 0; k < std::ssize(order_); ++k) {
    const Index i = order_[static_cast<std::size_t>(k)];
    if (!open[i]) continue;
    Now& lanes = now[static_cast<std::size_t>(k / run)];
    for (Index c = 0; c < 3; ++c) {
      lanes.at[c][k % run] = static_cast<float>(places(i, c));
      if (known) lanes.normal[c][k % run] = static_cast<float>(normals(i, c));
    }
  }
  const Limits limits{(1.0f + rounding) * static_cast<float>(near * near),
                      known ? static_cast<float>(facing) + rounding : 1.0f, far_};
  std::vector<std::vector<Index>> result(now.size());
  const auto descend = [&](const auto& self, Index level, Index a, Index b) -> void {
    if (boxes.box(level, a).gap(boxes.box(level, b)) > limits.near) return;
    if (known && sides.box(level, a).least_product(sides.box(level, b)) > limits.facing) return;
    const std::vector<Ball>& balls = balls_[static_cast<std::size_t>(level)];
    const Ball &first = balls[static_cast<std::size_t>(a)], &second = balls[static_cast<std::size_t>(b)];
    const float left = first.left + second.left;
    if (left > 0.0f && (first.middle - second.middle).square().sum() < left * left) return;
    const auto x = static_cast<std::size_t>(a), y = static_cast<std::size_t>(b);
    if (level > 0) {
      const Index below = boxes.count(level - 1);
      for (Index i = 2 * a; i < std::min(2 * a + 2, below); ++i)
        for (Index j = a == b ? i : 2 * b; j < std::min(2 * b + 2, below); ++j) self(self, level - 1, i, j);
    } else if (meet(rest_[x], rest_[y], now[x], now[y], limits)) {
      result[x].push_back(b);
      if (a != b) result[y].push_back(a);
    }
  };
  descend(descend, boxes.levels() - 1, 0, 0);
  return result;
}

}  // namespace arapfields
