// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/sides.h"

#include <algorithm>
#include <utility>

#include "core/point_grid.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// Whether the obstacle's normals (n,3) push a patch with these rest normals to one side of it as a whole.
bool comes_out(PointsIn ways_out, PointsIn normals) {
  const Vec3 mean = normals.colwise().mean();
  if (mean.norm() < P::one_sided) return false;
  const Vector cosines = ways_out * mean.normalized();
  return (cosines.minCoeff() > P::pushes_against && cosines.maxCoeff() > P::pushes_along) ||
         (cosines.maxCoeff() < -P::pushes_against && cosines.minCoeff() < -P::pushes_along);
}

/// Samples near an obstacle, and the search for those that it crosses. Rows index these samples alone.
class SamplesBeside {
 public:
  /// `places` (n,3) are the positions of all samples, `distances` (n) their signed distances to the obstacle.
  SamplesBeside(const ContactSurface& obstacle, const ContactPoints& points, PointsIn places,
                const Vector& distances);
  /// Samples to be left where they are: connected patches inside the obstacle that it crosses, their outside
  /// neighbours, and outside neighbours of each other with the obstacle in between.
  std::vector<Index> crossed();

 private:
  static std::vector<Index> nearer(const Vector& distances, double reach);
  bool is_inside(Index row) const { return distances_[row] < 0.0; }
  bool are_opposite(Index row, Index other) const {
    return normals_.row(row).dot(normals_.row(other)) <= P::opposite_cosine;
  }
  template <class Take>
  void each_neighbour(Index row, Take&& take) const;
  void mark(Index row) { marked_[static_cast<std::size_t>(row)] = true; }
  void mark_patch(Index row);
  void mark_between(const std::vector<Index>& from, const std::vector<Index>& to);

  const ContactSurface& obstacle_;
  const ContactPoints& points_;
  double reach_;
  std::vector<Index> samples_;
  Points places_;
  Points rest_;
  Vector distances_;
  Points normals_;
  PointGrid grid_;  // of the rest positions
  std::vector<Index> cells_;
  std::vector<bool> marked_;   // the result of crossed()
  std::vector<bool> visited_;  // rows of patches that were visited
};

std::vector<Index> SamplesBeside::nearer(const Vector& distances, double reach) {
  std::vector<Index> samples;
  for (Index i = 0; i < distances.size(); ++i)
    if (distances[i] < reach) samples.push_back(i);
  return samples;
}

SamplesBeside::SamplesBeside(const ContactSurface& obstacle, const ContactPoints& points, PointsIn places,
                             const Vector& distances)
    : obstacle_(obstacle),
      points_(points),
      reach_(P::crossing_reach * points.spacing()),
      samples_(nearer(distances, reach_)),
      places_(rows_of(places, samples_)),
      rest_(points.rest(samples_)),
      distances_(entries_of(distances, samples_)),
      normals_(obstacle.nearest(places_).normals),
      grid_(rest_, reach_),
      cells_(grid_.cell_of_each()),
      marked_(samples_.size()),
      visited_(samples_.size()) {}

/// Calls take(other) for the neighbours of a row at rest.
template <class Take>
void SamplesBeside::each_neighbour(Index row, Take&& take) const {
  grid_.near(cells_[static_cast<std::size_t>(row)], [&](Index cell) {
    for (const Index other : grid_.rows(cell))
      if (other != row && (rest_.row(other) - rest_.row(row)).norm() < reach_) take(other);
  });
}

/// Marks the connected patch of inside samples around a row, and its outside neighbours, unless the patch can
/// be pushed out as a whole.
void SamplesBeside::mark_patch(Index row) {
  std::vector<Index> part{row}, samples, edge;
  visited_[static_cast<std::size_t>(row)] = true;
  for (std::size_t next = 0; next < part.size(); ++next) {
    samples.push_back(samples_[static_cast<std::size_t>(part[next])]);
    each_neighbour(part[next], [&](Index other) {
      if (visited_[static_cast<std::size_t>(other)]) return;
      if (!is_inside(other)) return edge.push_back(other);
      visited_[static_cast<std::size_t>(other)] = true;
      part.push_back(other);
    });
  }
  if (comes_out(rows_of(normals_, part), points_.normals(samples))) return;
  for (const std::vector<Index>* rows : {&part, &edge})
    for (const Index each : *rows) mark(each);
}

/// Marks pairs of rows (from_k, to_k) with the obstacle in between.
void SamplesBeside::mark_between(const std::vector<Index>& from, const std::vector<Index>& to) {
  const std::vector<ContactSurface::Hit> hits =
      obstacle_.first_hits(rows_of(places_, from), rows_of(places_, to));
  for (std::size_t k = 0; k < hits.size(); ++k) {
    if (hits[k].parameter > 1.0) continue;
    mark(from[k]);
    mark(to[k]);
  }
}

std::vector<Index> SamplesBeside::crossed() {
  std::vector<Index> from, to;  // pairs outside, on opposite sides
  const Index count = std::ssize(samples_);
  for (Index row = 0; row < count; ++row)
    each_neighbour(row, [&](Index other) {
      if (!are_opposite(row, other)) return;
      if (is_inside(row) && !visited_[static_cast<std::size_t>(row)]) mark_patch(row);
      if (is_inside(row) || is_inside(other) || row > other) return;
      from.push_back(row);
      to.push_back(other);
    });
  mark_between(from, to);
  std::vector<Index> result;
  for (Index row = 0; row < count; ++row)
    if (marked_[static_cast<std::size_t>(row)]) result.push_back(samples_[static_cast<std::size_t>(row)]);
  return result;
}

}  // namespace

ContactSides::ContactSides(Index points, std::size_t surfaces)
    : outside(surfaces),
      anchors(surfaces),
      clearance(points, static_cast<Index>(surfaces)),
      crossed(surfaces) {}

void ContactSides::start(Index surface, const ContactSurface& obstacle, PointsIn places) {
  const auto k = static_cast<std::size_t>(surface);
  outside[k] = anchors[k] = places;
  clearance.col(surface) = obstacle.distances(places);
  crossed[k].clear();
}

void ContactSides::move_with(Index surface, const Mat4& motion) {
  const auto k = static_cast<std::size_t>(surface);
  outside[k] = affine_image(outside[k], motion);
  anchors[k] = affine_image(anchors[k], motion);
}

void ContactSides::add(const std::vector<Index>& like) {
  const Index before = clearance.rows(), count = before + std::ssize(like);
  clearance.conservativeResize(count, Eigen::NoChange);
  clearance.bottomRows(std::ssize(like)) = clearance(like, Eigen::all).eval();
  for (std::vector<Points>* each : {&outside, &anchors})
    for (Points& places : *each) {
      places.conservativeResize(count, Eigen::NoChange);
      places.bottomRows(std::ssize(like)) = places(like, Eigen::all).eval();
    }
}

void ContactSides::find_crossings(Index surface, const ContactSurface& obstacle, const ContactPoints& points,
                                  const RefinedPoints& refined, PointsIn places) {
  std::vector<bool>& samples = crossed[static_cast<std::size_t>(surface)];
  samples.clear();
  if (obstacle.is_ground() || obstacle.is_sheet()) return;
  const Index count = points.sample_count();
  const Vector distances = clearance.col(surface).head(count);
  const std::vector<Index> rows = SamplesBeside(obstacle, points, places.topRows(count), distances).crossed();
  if (rows.empty()) return;
  samples.assign(static_cast<std::size_t>(count), false);
  for (const Index row : rows) {
    samples[static_cast<std::size_t>(row)] = true;
    if (clearance(row, surface) < 0.0) clearance(row, surface) = left_inside;
  }
  for (Index row = count; row < clearance.rows(); ++row)
    if (clearance(row, surface) < 0.0 && crosses(surface, points.sample_of(row, refined)))
      clearance(row, surface) = left_inside;
}

std::vector<Index> ContactSides::crossing_surfaces() const {
  std::vector<Index> surfaces;
  for (Index k = 0; k < std::ssize(crossed); ++k)
    if (!crossed[static_cast<std::size_t>(k)].empty() && (clearance.col(k).array() == left_inside).any())
      surfaces.push_back(k);
  return surfaces;
}

void ContactSides::begin_beside_crossings(Index surface, const ContactSurface& obstacle,
                                          const std::vector<Index>& samples, PointsIn places) {
  std::vector<Index> rows;
  const Index first = clearance.rows() - std::ssize(samples);
  for (Index row = first; row < clearance.rows(); ++row)
    if (crosses(surface, samples[static_cast<std::size_t>(row - first)])) rows.push_back(row);
  if (rows.empty()) return;
  const Points begun = rows_of(places, rows);
  const Vector distances = obstacle.distances(begun);
  for (Index i = 0; i < distances.size(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    clearance(row, surface) = distances[i] < 0.0 ? left_inside : distances[i];
    outside[static_cast<std::size_t>(surface)].row(row) = begun.row(i);
  }
}

}  // namespace arapfields
