// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/oriented_points.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr Index leaf = 12, grain = 256;
/// Subtrees that a search has still to visit: one a level, and each level halves the points.
constexpr std::size_t most_levels = 64;

}  // namespace

OrientedPoints::OrientedPoints(PointsIn points, PointsIn normals) : points_(points), normals_(normals) {
  rows_.resize(points.rows());
  std::iota(rows_.begin(), rows_.end(), Index{0});
  std::size_t nodes = 1;
  for (Index count = points.rows(); count > leaf; count = (count + 1) / 2) nodes = 2 * nodes + 1;
  nodes_.resize(nodes);
  build(0, 0, points.rows());
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    points_.row(i) = points.row(rows_[i]);
    normals_.row(i) = normals.row(rows_[i]);
  }
}

void OrientedPoints::build(std::size_t node, Index begin, Index end) {
  nodes_[node].begin = begin;
  nodes_[node].end = end;
  if (end - begin <= leaf || 2 * node + 2 >= nodes_.size()) return;
  Vec3 low = points_.row(rows_[begin]), high = low;
  for (Index i = begin; i < end; ++i) {
    const Vec3 p = points_.row(rows_[i]);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  Index axis = 0;
  (high - low).maxCoeff(&axis);
  const Index middle = begin + (end - begin) / 2;
  std::nth_element(rows_.begin() + begin, rows_.begin() + middle, rows_.begin() + end, [&](Index a, Index b) {
    return points_(a, axis) != points_(b, axis) ? points_(a, axis) < points_(b, axis) : a < b;
  });
  nodes_[node].axis = static_cast<int>(axis);
  nodes_[node].split = points_(rows_[middle], axis);
  build(2 * node + 1, begin, middle);
  build(2 * node + 2, middle, end);
}

/// Calls visit(row of the tree) for all points that may lie within √square, which it may lower.
template <class Visit>
void OrientedPoints::search(const Vec3& place, double& square, Visit&& visit) const {
  struct Pending {
    std::size_t node;
    double square;  // of the offset to its half space
  };
  std::array<Pending, most_levels> stack;
  std::size_t pending = 0;
  stack[pending++] = {0, 0.0};
  while (pending > 0) {
    Pending next = stack[--pending];
    if (next.square > square) continue;
    while (nodes_[next.node].axis >= 0) {
      const Node& node = nodes_[next.node];
      const double offset = place[node.axis] - node.split;
      const std::size_t below = 2 * next.node + 1, above = below + 1;
      stack[pending++] = {offset < 0.0 ? above : below, std::max(next.square, offset * offset)};
      next.node = offset < 0.0 ? below : above;
    }
    for (Index i = nodes_[next.node].begin; i < nodes_[next.node].end; ++i) visit(i);
  }
}

std::vector<Index> OrientedPoints::nearest(PointsIn others, PointsIn normals, double turn) const {
  std::vector<Index> result(others.rows());
  parallel_for(0, others.rows(), grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 place = others.row(i), normal = normals.row(i);
      double best = std::numeric_limits<double>::infinity();
      Index nearest_row = 0;
      search(place, best, [&](Index k) {
        const double square = (points_.row(k).transpose() - place).squaredNorm() +
                              turn * turn * (normals_.row(k).transpose() - normal).squaredNorm();
        if (square < best || (square == best && rows_[k] < nearest_row)) {
          best = square;
          nearest_row = rows_[k];
        }
      });
      result[i] = nearest_row;
    }
  });
  return result;
}

std::vector<Index> OrientedPoints::within(const Vec3& place, double distance) const {
  std::vector<Index> result;
  double square = distance * distance;
  search(place, square, [&](Index k) {
    if ((points_.row(k).transpose() - place).squaredNorm() <= square) result.push_back(rows_[k]);
  });
  return result;
}

}  // namespace arapfields
