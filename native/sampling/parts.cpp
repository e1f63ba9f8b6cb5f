// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/parts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/point_grid.h"

namespace arapfields {
namespace {

/// Cell size, as a fraction of the extent, of the grid for the first estimate of the spacing.
constexpr double coarse_share = 0.1;
/// Threshold of single-linkage clustering, in median distances to the nearest point.
constexpr double longest_step = 6.0;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

/// Calls visit(j, square) for the other points j that lie in a cell near point i's.
template <class Visit>
void near_points(const PointGrid& grid, Index cell, PointsIn points, Index i, Visit&& visit) {
  grid.near(cell, [&](Index other) {
    for (const Index j : grid.rows(other))
      if (j != i) visit(j, (points.row(i) - points.row(j)).squaredNorm());
  });
}

/// The median distance to the nearest point; 0 if all points coincide.
double spacing_of(PointsIn points) {
  const double extent = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
  const auto count = static_cast<double>(points.rows());
  if (!(extent > 0.0)) return 0.0;
  const PointGrid coarse(points, coarse_share * extent);  // a cell holds about its size squared of the area
  const PointGrid grid(points, coarse_share * extent * std::sqrt(static_cast<double>(coarse.size()) / count));
  const std::vector<Index> cells = grid.cell_of_each();
  std::vector<double> squares(cells.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < cells.size(); ++i)
    near_points(grid, cells[i], points, static_cast<Index>(i),
                [&](Index, double square) { squares[i] = std::min(squares[i], square); });
  const auto middle = squares.begin() + std::ssize(squares) / 2;
  std::nth_element(squares.begin(), middle, squares.end());
  return std::min(std::sqrt(*middle), extent);
}

}  // namespace

std::vector<Index> parts_of(PointsIn points) {
  std::vector<Index> parts(static_cast<std::size_t>(points.rows()), -1);
  const double step = points.rows() > 0 ? longest_step * spacing_of(points) : 0.0;
  if (!(step > 0.0)) return std::vector<Index>(parts.size(), 0);
  const PointGrid grid(points, step);
  const std::vector<Index> cells = grid.cell_of_each();
  std::vector<Index> open;
  for (Index start = 0, count = 0; start < points.rows(); ++start) {
    if (parts[at(start)] >= 0) continue;
    parts[at(start)] = count;
    for (open.push_back(start); !open.empty();) {
      const Index i = open.back();
      open.pop_back();
      near_points(grid, cells[at(i)], points, i, [&](Index j, double square) {
        if (square > step * step || std::exchange(parts[at(j)], count) >= 0) return;
        open.push_back(j);
      });
    }
    ++count;
  }
  return parts;
}

std::vector<PartLink> spanning_links(PointsIn points, const std::vector<Index>& parts,
                                     std::vector<Index> joined, const MayJoin& may_join) {
  std::vector<PartLink> links;
  const std::vector<Index> first = joined;
  std::vector<Index> left(parts.size()), from(parts.size(), -1);  // points not joined yet, and whereto
  std::iota(left.begin(), left.end(), Index{0});
  std::vector<double> squares(parts.size(), std::numeric_limits<double>::infinity());
  while (true) {
    const auto ends = std::stable_partition(left.begin(), left.end(), [&](Index i) {
      return std::find(joined.begin(), joined.end(), parts[at(i)]) == joined.end();
    });
    const std::vector<Index> added(ends, left.end());
    left.erase(ends, left.end());
    if (left.empty() || added.empty()) return links;
    for (const Index j : left)
      for (const Index i : added) {
        const double square = (points.row(i) - points.row(j)).squaredNorm();
        if (square < squares[at(j)] && (!may_join || may_join(i, j)))
          squares[at(j)] = square, from[at(j)] = i;
      }
    const Index next = *std::min_element(left.begin(), left.end(),
                                         [&](Index a, Index b) { return squares[at(a)] < squares[at(b)]; });
    if (from[at(next)] < 0) {  // no part that is left may be joined: they are joined nevertheless
      joined = first;
      for (const auto& [known, added_point] : links) joined.push_back(parts[at(added_point)]);
      const std::vector<PartLink> more = spanning_links(points, parts, joined);
      links.insert(links.end(), more.begin(), more.end());
      return links;
    }
    links.emplace_back(from[at(next)], next);
    joined = {parts[at(next)]};
  }
}

}  // namespace arapfields
