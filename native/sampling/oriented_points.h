// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

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
  /// For each of the others (m,3), the point (m) with the least |p − q|² + turn² |n − m|². On all threads.
  std::vector<Index> nearest(PointsIn others, PointsIn normals, double turn) const;
  /// Points within a distance of a place, in no order.
  std::vector<Index> within(const Vec3& place, double distance) const;

 private:
  struct Node {
    double split = 0.0;
    int axis = -1;  // −1: a leaf
    Index begin = 0, end = 0;
  };
  void build(std::size_t node, Index begin, Index end);
  template <class Visit>
  void search(const Vec3& place, double& square, Visit&& visit) const;

  Points points_, normals_;  // in the tree's order
  std::vector<Index> rows_;  // original row of each
  std::vector<Node> nodes_;  // children of node i: 2 i + 1, 2 i + 2
};

}  // namespace arapfields
