// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// A k-d tree over points with unit normals, for the nearest neighbour in position and direction together.
/// Built once; queries may come from any number of threads.
class ARAPFIELDS_EXPORT_TO_TESTS OrientedPoints {
 public:
  OrientedPoints() = default;
  /// Points (n,3), n ≥ 1, and normals (n,3).
  OrientedPoints(PointsIn points, PointsIn normals);

  Index size() const { return points_.rows(); }
  /// For each of the others (m,3), the point (m) that minimises |p − q|² + turn² |n − m|². On all threads.
  /// `guesses`, such as the result of a similar query, shorten the search.
  std::vector<Index> nearest(PointsIn others, PointsIn normals, double turn,
                             const std::vector<Index>& guesses = {}) const;
  /// Points within a distance of a place, in no order.
  std::vector<Index> within(const Vec3& place, double distance) const;
  /// Calls visit(row, point, normal) for each of them.
  template <class Visit>
  void visit_within(const Vec3& place, double distance, Visit&& visit) const;

 private:
  struct Node {
    double split = 0.0;
    int axis = -1;  // −1: a leaf
    Index begin = 0, end = 0;
  };
  void build(std::size_t node, Index begin, Index end);
  template <class Visit>
  void search(const Vec3& place, double& square, Visit&& visit) const;

  Points points_, normals_;    // in the tree's order
  std::vector<Index> rows_;    // original row of each
  std::vector<Index> places_;  // where each original row is
  std::vector<Node> nodes_;    // children of node i: 2 i + 1, 2 i + 2
};

/// Calls visit(row of the tree) for all points that may lie within √square, which it may lower.
template <class Visit>
void OrientedPoints::search(const Vec3& place, double& square, Visit&& visit) const {
  // At most one subtree a level is pending, and each level halves the points.
  constexpr std::size_t most_levels = 64;
  constexpr double rounding = 1e-14;  // of sums of squares
  struct Pending {
    std::size_t node;
    Vec3 offset;  // to its box
  };
  std::array<Pending, most_levels> stack;
  std::size_t pending = 0;
  stack[pending++] = {0, Vec3::Zero()};
  while (pending > 0) {
    Pending next = stack[--pending];
    if ((1.0 - rounding) * next.offset.squaredNorm() > square) continue;
    while (nodes_[next.node].axis >= 0) {
      const Node& node = nodes_[next.node];
      const double offset = place[node.axis] - node.split;
      const std::size_t below = 2 * next.node + 1, above = below + 1;
      Pending& farther = stack[pending++];
      farther = {offset < 0.0 ? above : below, next.offset};
      farther.offset[node.axis] = offset;
      next.node = offset < 0.0 ? below : above;
    }
    for (Index i = nodes_[next.node].begin; i < nodes_[next.node].end; ++i) visit(i);
  }
}

template <class Visit>
void OrientedPoints::visit_within(const Vec3& place, double distance, Visit&& visit) const {
  double square = distance * distance;
  search(place, square, [&](Index i) {
    if ((points_.row(i).transpose() - place).squaredNorm() <= square)
      visit(rows_[i], Vec3(points_.row(i)), Vec3(normals_.row(i)));
  });
}

}  // namespace arapfields
