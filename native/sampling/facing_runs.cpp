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
  for (Index nodes = count(), rows = run; nodes > 0; rows *= 4) {  // children of this many rows
    nodes = (nodes + 3) / 4;
    std::vector<Balls>& balls = balls_.emplace_back();
    for (Index k = 0; k < nodes; ++k) balls.push_back(balls_of(rest, k, rows, far));
    if (nodes == 1) break;
  }
  rest_.resize(static_cast<std::size_t>(count()));
  for (Index i = 0; i < rest.rows(); ++i)
    for (Index c = 0; c < rest.cols(); ++c)
      rest_[static_cast<std::size_t>(i / run)].at[c][i % run] = static_cast<float>(rest(i, c));
}

/// The balls around the rest coordinates of a node's children, which have so many rows each.
FacingRuns::Balls FacingRuns::balls_of(const RowMatrix<double>& rest, Index parent, Index rows, double far) {
  Balls balls;
  for (Lanes& lanes : balls.middle) lanes.setZero();
  balls.left.setZero();
  for (Index child = 0; child < 4; ++child) {
    const Index first = (4 * parent + child) * rows, size = std::min(rows, rest.rows() - first);
    if (size <= 0) break;
    const auto members = rest.middleRows(first, size);
    const Eigen::RowVectorXd middle = 0.5 * (members.colwise().minCoeff() + members.colwise().maxCoeff());
    const double radius = std::sqrt((members.rowwise() - middle).rowwise().squaredNorm().maxCoeff());
    for (Index c = 0; c < 8; ++c) balls.middle[c][child] = static_cast<float>(middle[c]);
    balls.left[child] = static_cast<float>(0.5 * (1.0 - rounding) * far - radius);
  }
  return balls;
}

/// The boxes around the open samples of the nodes' children, for each level.
std::vector<std::vector<FacingRuns::Boxes>> FacingRuns::boxes_of(const std::vector<Now>& now) const {
  Boxes empty;
  for (int c = 0; c < 3; ++c) {
    empty.low[c] = Lanes::Constant(nowhere);
    empty.high[c] = -empty.low[c];
  }
  std::vector<std::vector<Boxes>> boxes;
  for (const std::vector<Balls>& level : balls_) boxes.emplace_back(level.size(), empty);
  for (std::size_t k = 0; k < now.size(); ++k)
    for (int c = 0; c < 3; ++c) {
      const Lanes& at = now[k].at[c];
      boxes[0][k / 4].low[c][static_cast<Index>(k % 4)] = at.minCoeff();
      boxes[0][k / 4].high[c][static_cast<Index>(k % 4)] = (at == nowhere).select(-nowhere, at).maxCoeff();
    }
  for (std::size_t level = 1; level < boxes.size(); ++level)
    for (std::size_t k = 0; k < boxes[level - 1].size(); ++k)
      for (int c = 0; c < 3; ++c) {
        boxes[level][k / 4].low[c][static_cast<Index>(k % 4)] = boxes[level - 1][k].low[c].minCoeff();
        boxes[level][k / 4].high[c][static_cast<Index>(k % 4)] = boxes[level - 1][k].high[c].maxCoeff();
      }
  return boxes;
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
  const bool known = normals.rows() > 0;
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
  const std::vector<std::vector<Boxes>> boxes = boxes_of(now);
  std::vector<std::vector<Index>> result(now.size());
  const auto pair = [&](std::size_t a, std::size_t b) {
    if (!meet(rest_[a], rest_[b], now[a], now[b], limits)) return;
    result[a].push_back(static_cast<Index>(b));
    if (a != b) result[b].push_back(static_cast<Index>(a));
  };
  const auto descend = [&](const auto& self, std::size_t level, std::size_t a, std::size_t b) -> void {
    const Boxes &box = boxes[level][a], &others = boxes[level][b];
    const Balls &ball = balls_[level][a], &beside = balls_[level][b];
    for (Index i = 0; i < 4; ++i) {
      Lanes gap = Lanes::Zero(), apart = Lanes::Zero();
      for (int c = 0; c < 3; ++c)
        gap += (box.low[c][i] - others.high[c]).max(others.low[c] - box.high[c][i]).max(0.0f).square();
      if (gap.minCoeff() > limits.near) continue;
      for (int c = 0; c < 8; ++c) apart += (beside.middle[c] - ball.middle[c][i]).square();
      const Lanes left = (beside.left + ball.left[i]).max(0.0f).square();
      for (Index j = a == b ? i : 0; j < 4; ++j) {
        if (gap[j] > limits.near || apart[j] < left[j]) continue;
        const std::size_t x = 4 * a + static_cast<std::size_t>(i), y = 4 * b + static_cast<std::size_t>(j);
        if (level > 0)
          self(self, level - 1, x, y);
        else
          pair(x, y);
      }
    }
  };
  if (!boxes.empty()) descend(descend, boxes.size() - 1, 0, 0);
  return result;
}

}  // namespace arapfields
