// SPDX-License-Identifier: GPL-3.0-or-later
// Where an obstacle crosses a surface, its nearest sides lie opposite each other, and nothing says which one
// the surface comes from.
#include <algorithm>
#include <utility>

#include "sampling/point_grid.h"
#include "sampling/sample_choice.h"
#include "solve/radial/contact_ways.h"

namespace arapfields {
namespace {

/// The cosine of normals that lie opposite each other.
constexpr double opposite = -0.5;
/// Samples are beside each other that lie no farther apart at rest, in spacings.
constexpr double nearby = 3.0;
/// A part of a surface has one side where its mean normal is as long; along it ways out lead whose cosine is
/// at least `along` somewhere, and nowhere beyond `against` on the other side.
constexpr double one_sided = 0.5, along = 0.7, against = -0.2;

/// Whether the ways out lead all to one side of the surface, so that it comes out whole.
bool comes_out(PointsIn ways_out, PointsIn normals) {
  const Vec3 mean = normals.colwise().mean();
  if (mean.norm() < one_sided) return false;
  const Vector cosines = ways_out * mean.normalized();
  return (cosines.minCoeff() > against && cosines.maxCoeff() > along) ||
         (cosines.maxCoeff() < -against && cosines.minCoeff() < -along);
}

/// The samples that lie inside where an obstacle crosses the surface, with all that are inside beside them,
/// and those outside, between which and their neighbours it crosses. `places` are those of the samples,
/// `distances` theirs from the obstacle.
std::vector<Index> crossed_samples(const BarrierSurface& obstacle, const ContactPoints& points,
                                   PointsIn places, const Vector& distances) {
  std::vector<Index> result;
  if (obstacle.is_flat() || obstacle.is_sheet()) return result;
  const double reach = nearby * points.spacing();
  std::vector<Index> near;
  for (Index i = 0; i < points.sample_count(); ++i)
    if (distances[i] < reach) near.push_back(i);
  if (near.empty()) return result;
  const Points theirs = rows_of(places, near), rest = points.rest(near);
  const PointGrid grid(rest, reach);
  const std::vector<Index> cells = grid.cell_of_each();
  const Points normals = obstacle.nearest(theirs).normals;
  const auto is_inside = [&](Index m) { return distances[near[static_cast<std::size_t>(m)]] < 0.0; };
  const auto each_neighbour = [&](Index m, auto&& take) {
    grid.near(cells[static_cast<std::size_t>(m)], [&](Index cell) {
      for (const Index other : grid.rows(cell))
        if (other != m && (rest.row(other) - rest.row(m)).norm() < reach) take(other);
    });
  };
  std::vector<bool> left(near.size()), seen(near.size());
  // All that is inside beside m, and what is outside there.
  const auto leave_part = [&](Index m) {
    std::vector<Index> part{m}, samples, edge;
    seen[static_cast<std::size_t>(m)] = true;
    for (std::size_t next = 0; next < part.size(); ++next) {
      samples.push_back(near[static_cast<std::size_t>(part[next])]);
      each_neighbour(part[next], [&](Index other) {
        if (seen[static_cast<std::size_t>(other)]) return;
        if (!is_inside(other)) return edge.push_back(other);
        seen[static_cast<std::size_t>(other)] = true;
        part.push_back(other);
      });
    }
    if (comes_out(rows_of(normals, part), points.normals(samples))) return;
    for (const std::vector<Index>* rows : {&part, &edge})
      for (const Index row : *rows) left[static_cast<std::size_t>(row)] = true;
  };
  std::vector<std::pair<Index, Index>> pairs;  // outside, on opposite sides
  for (Index m = 0; m < std::ssize(near); ++m)
    each_neighbour(m, [&](Index other) {
      if (normals.row(m).dot(normals.row(other)) > opposite) return;
      if (is_inside(m) && !seen[static_cast<std::size_t>(m)])
        leave_part(m);
      else if (!is_inside(m) && !is_inside(other) && m < other)
        pairs.emplace_back(m, other);
    });
  std::vector<Index> from, to;
  for (const auto& [a, b] : pairs) {
    from.push_back(a);
    to.push_back(b);
  }
  const std::vector<BarrierSurface::Hit> hits =
      obstacle.first_hits(rows_of(theirs, from), rows_of(theirs, to));
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (hits[k].share <= 1.0)
      left[static_cast<std::size_t>(pairs[k].first)] = left[static_cast<std::size_t>(pairs[k].second)] = true;
  for (Index m = 0; m < std::ssize(near); ++m)
    if (left[static_cast<std::size_t>(m)]) result.push_back(near[static_cast<std::size_t>(m)]);
  return result;
}

}  // namespace

void ContactWays::cross(Index surface, const BarrierSurface& obstacle, const ContactPoints& points,
                        PointsIn places) {
  std::vector<bool>& samples = crossed[static_cast<std::size_t>(surface)];
  samples.clear();
  const Index count = points.sample_count();
  const std::vector<Index> rows =
      crossed_samples(obstacle, points, places.topRows(count), clear.col(surface).head(count));
  if (rows.empty()) return;
  samples.assign(static_cast<std::size_t>(count), false);
  for (const Index row : rows) {
    samples[static_cast<std::size_t>(row)] = true;
    if (clear(row, surface) < 0.0) clear(row, surface) = left_inside;
  }
  for (Index row = count; row < clear.rows(); ++row)
    if (clear(row, surface) < 0.0 && crosses(surface, points.sample_of(row)))
      clear(row, surface) = left_inside;
}

std::vector<Index> ContactWays::crossing() const {
  std::vector<Index> surfaces;
  for (Index k = 0; k < std::ssize(crossed); ++k)
    if (!crossed[static_cast<std::size_t>(k)].empty() && (clear.col(k).array() == left_inside).any())
      surfaces.push_back(k);
  return surfaces;
}

void ContactWays::begin_beside_crossings(Index surface, const BarrierSurface& obstacle,
                                         const std::vector<Index>& samples, PointsIn places) {
  std::vector<Index> rows;
  const Index first = clear.rows() - std::ssize(samples);
  for (Index row = first; row < std::min(clear.rows(), places.rows()); ++row)
    if (crosses(surface, samples[static_cast<std::size_t>(row - first)])) rows.push_back(row);
  if (rows.empty()) return;
  const Points begun = rows_of(places, rows);
  const Vector distances = obstacle.distances(begun);
  for (Index i = 0; i < distances.size(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    clear(row, surface) = distances[i] < 0.0 ? left_inside : distances[i];
    seen[static_cast<std::size_t>(surface)].row(row) = begun.row(i);
  }
}

}  // namespace arapfields
