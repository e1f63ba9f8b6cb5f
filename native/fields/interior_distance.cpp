// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/interior_distance.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include "core/parallel.h"
#include "sampling/inner_balls.h"

namespace arapfields {
namespace {

/// Distance, as a fraction of the smaller radius, by which a centre may be outside of the larger ball.
constexpr double overlap_share = 0.25;
/// Neighbours on one sheet: largest distance, in spacings, and least cosine of the normals.
constexpr double sheet_spacings = 2.5, sheet_cosine = 0.3;
/// Both sides of a thin part: its largest width, in spacings, and largest cosine of the normals.
constexpr double thin_spacings = 0.8, opposite_cosine = -0.9;
/// InnerBallRules: least_cosine, for the widths of thin parts.
constexpr double thin_cosine = 0.2;

}  // namespace

InteriorGraph::InteriorGraph(PointsIn nodes, PointsIn normals, double spacing, const MayJoin& may_join)
    : edges_(nodes.rows()) {
  const double extent = (nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()).maxCoeff();
  const Vector radii = inner_radii(nodes, normals, nodes, normals, {.most = extent});
  const Points centers = nodes - radii.asDiagonal() * normals;
  const double near = sheet_spacings * spacing;
  const Vector thin = inner_radii(nodes, normals, nodes, normals,
                                  {.most = extent, .least_cosine = thin_cosine, .near = near});
  // Whether two nodes lie opposite each other on a part thinner than the spacing, with no other part between:
  // in the mean of both planes' distances the part's curvature cancels.
  const auto are_opposite = [&](Index i, Index j) {
    const double width = 2.0 * std::max(thin[i], thin[j]);
    if (width > thin_spacings * spacing || normals.row(i).dot(normals.row(j)) > opposite_cosine) return false;
    const double apart = 0.5 * (nodes.row(i) - nodes.row(j)).dot(normals.row(i) - normals.row(j));
    return apart > 0.0 && apart < (1.0 + overlap_share) * width;
  };
  parallel_for(0, nodes.rows(), 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < nodes.rows(); ++j) {
        if (i == j) continue;
        const double square = (nodes.row(i) - nodes.row(j)).squaredNorm();
        const double larger = std::max(radii[i], radii[j]), smaller = std::min(radii[i], radii[j]);
        const double limit = larger + overlap_share * smaller;
        if (((centers.row(i) - centers.row(j)).squaredNorm() < limit * limit ||
             (square < near * near &&
              (normals.row(i).dot(normals.row(j)) > sheet_cosine || are_opposite(i, j)))) &&
            (!may_join || may_join(i, j)))
          edges_[i].push_back({static_cast<std::int32_t>(j), static_cast<float>(std::sqrt(square))});
      }
  });
  join_parts(nodes, may_join);
}

/// Joins the graph's connected components.
void InteriorGraph::join_parts(PointsIn nodes, const MayJoin& may_join) {
  std::vector<Index> parts(edges_.size(), -1), open;
  for (Index start = 0, count = 0; start < size(); ++start) {
    if (parts[start] >= 0) continue;
    parts[start] = count;
    for (open.push_back(start); !open.empty();) {
      const Index i = open.back();
      open.pop_back();
      for (const Edge& edge : edges(i))
        if (std::exchange(parts[edge.to], count) < 0) open.push_back(edge.to);
    }
    ++count;
  }
  for (const auto& [from, to] : spanning_links(nodes, parts, {0}, may_join)) {
    const auto length = static_cast<float>(std::sqrt((nodes.row(from) - nodes.row(to)).squaredNorm()));
    edges_[from].push_back({static_cast<std::int32_t>(to), length});
    edges_[to].push_back({static_cast<std::int32_t>(from), length});
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

std::vector<float> InteriorGraph::distances_from(std::vector<float> start, float longest) const {
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
      if (length + edge.length < start[edge.to] && length + edge.length <= longest) {
        start[edge.to] = length + edge.length;
        queue.emplace(start[edge.to], edge.to);
      }
  }
  return start;
}

}  // namespace arapfields
