// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/oriented_points.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr Index leaf = 12, queries_at_once = 256;

}  // namespace

OrientedPoints::OrientedPoints(PointsIn points, PointsIn normals) : points_(points), normals_(normals) {
  rows_.resize(points.rows());
  std::iota(rows_.begin(), rows_.end(), Index{0});
  std::size_t nodes = 1;
  for (Index count = points.rows(); count > leaf; count = (count + 1) / 2) nodes = 2 * nodes + 1;
  nodes_.resize(nodes);
  build(0, 0, points.rows());
  places_.resize(rows_.size());
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    places_[rows_[i]] = static_cast<Index>(i);
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

std::vector<Index> OrientedPoints::nearest(PointsIn others, PointsIn normals, double turn,
                                           const std::vector<Index>& guesses) const {
  std::vector<Index> result(others.rows());
  const double turn_square = turn * turn;
  parallel_for(0, others.rows(), queries_at_once, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 place = others.row(i), normal = normals.row(i);
      double best = std::numeric_limits<double>::infinity();
      Index nearest_row = 0;
      const auto offer = [&](Index k) {
        double square = (points_.row(k).transpose() - place).squaredNorm();
        if (square > best) return;
        square += turn_square * (normals_.row(k).transpose() - normal).squaredNorm();
        if (square < best || (square == best && rows_[k] < nearest_row)) {
          best = square;
          nearest_row = rows_[k];
        }
      };
      if (!guesses.empty()) offer(places_[guesses[i]]);
      search(place, best, offer);
      result[i] = nearest_row;
    }
  });
  return result;
}

std::vector<Index> OrientedPoints::within(const Vec3& place, double distance) const {
  std::vector<Index> result;
  visit_within(place, distance, [&](Index row, const Vec3&, const Vec3&) { result.push_back(row); });
  return result;
}

}  // namespace arapfields
