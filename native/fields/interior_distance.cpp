// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/interior_distance.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>

#include "core/parallel.h"
#include "sampling/inner_balls.h"

namespace arapfields {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
/// Share of the smaller radius by which a center may lie outside the larger ball.
constexpr double overlap_share = 0.25;
/// Neighbours on one sheet: at most so many spacings apart, normals with at least this cosine.
constexpr double sheet_spacings = 2.5, sheet_cosine = 0.3;

}  // namespace

InteriorGraph::InteriorGraph(PointsIn nodes, PointsIn normals, double spacing, const MayJoin& may_join)
    : edges_(nodes.rows()) {
  const double extent = (nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()).maxCoeff();
  const Vector radii = inner_radii(nodes, normals, nodes, normals, {.most = extent});
  const Points centers = nodes - radii.asDiagonal() * normals;
  const double near = sheet_spacings * spacing;
  parallel_for(0, nodes.rows(), 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < nodes.rows(); ++j) {
        if (i == j) continue;
        const double square = (nodes.row(i) - nodes.row(j)).squaredNorm();
        const double larger = std::max(radii[i], radii[j]), smaller = std::min(radii[i], radii[j]);
        const double limit = larger + overlap_share * smaller;
        if (((centers.row(i) - centers.row(j)).squaredNorm() < limit * limit ||
             (square < near * near && normals.row(i).dot(normals.row(j)) > sheet_cosine)) &&
            (!may_join || may_join(i, j)))
          edges_[i].push_back({static_cast<std::int32_t>(j), static_cast<float>(std::sqrt(square))});
      }
  });
  join_parts(nodes);
}

/// Prim's tree, in which edges that exist cost nothing: what it adds joins the parts.
void InteriorGraph::join_parts(PointsIn nodes) {
  const Index n = size();
  std::vector<double> cost(n, infinity);
  std::vector<Index> from(n, 0);
  std::vector<bool> reached(n, false);
  std::vector<Index> open{0};
  for (Index count = 0; count < n;) {
    while (!open.empty()) {  // all that edges connect
      const Index i = open.back();
      open.pop_back();
      if (reached[i]) continue;
      reached[i] = true;
      ++count;
      for (const Edge& edge : edges(i))
        if (!reached[edge.to]) open.push_back(edge.to);
      if (count == n) return;
      cost[i] = -1.0;  // not yet offered to the rest
    }
    for (Index i = 0; i < n; ++i) {
      if (!reached[i] || cost[i] >= 0.0) continue;
      cost[i] = 0.0;
      for (Index j = 0; j < n; ++j) {
        if (reached[j]) continue;
        const double square = (nodes.row(i) - nodes.row(j)).squaredNorm();
        if (square < cost[j]) cost[j] = square, from[j] = i;
      }
    }
    Index best = -1;
    for (Index j = 0; j < n; ++j)
      if (!reached[j] && (best < 0 || cost[j] < cost[best])) best = j;
    const Index other = from[best];
    const float length = static_cast<float>(std::sqrt(cost[best]));
    edges_[best].push_back({static_cast<std::int32_t>(other), length});
    edges_[other].push_back({static_cast<std::int32_t>(best), length});
    open.push_back(best);
  }
}

RowMatrix<double> InteriorGraph::distances(Index sources) const {
  RowMatrix<double> result(size(), sources);
  parallel_for(0, sources, 1, [&](Index first, Index last) {
    for (Index s = first; s < last; ++s) {
      std::vector<float> start(size(), std::numeric_limits<float>::infinity());
      start[s] = 0.0f;
      const std::vector<float> lengths = distances_from(std::move(start));
      for (Index i = 0; i < size(); ++i) result(i, s) = static_cast<double>(lengths[i]);
    }
  });
  return result;
}

std::vector<float> InteriorGraph::distances_from(std::vector<float> start) const {
  using Entry = std::pair<float, std::int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
  for (Index i = 0; i < size(); ++i)
    if (start[i] < std::numeric_limits<float>::infinity())
      queue.emplace(start[i], static_cast<std::int32_t>(i));
  while (!queue.empty()) {
    const auto [length, node] = queue.top();
    queue.pop();
    if (length > start[node]) continue;
    for (const Edge& edge : edges(node))
      if (length + edge.length < start[edge.to]) {
        start[edge.to] = length + edge.length;
        queue.emplace(start[edge.to], edge.to);
      }
  }
  return start;
}

}  // namespace arapfields
