// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/fine_regions.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/parallel.h"
#include "core/random.h"
#include "core/smoothstep.h"
#include "mesh/pieces.h"
#include "mesh/sample_mesh.h"
#include "sampling/local_thickness.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// A sample is looked at within a spacing of places where the local thickness is less than this, in spacings.
constexpr double thin_radius = 1.0;
/// It belongs to a thin part beside another one if within so many spacings there are samples with an opposite
/// normal (the cosine is below) both behind it and in front of it (the cosine of the way and the normal is
/// above).
constexpr double beside = 1.0, opposite_cosine = -0.3, front_cosine = 0.3;
/// Most thin samples that are looked at, and fewest of a region.
constexpr Index most_thin = 8000, least_thin = 8;
/// A region is as large as the box of its thin samples, at most this share of the shape. It counts fully up
/// to the first of these shares of its size from them, and nothing from the second one; its points end at the
/// last.
constexpr double largest_share = 0.5, full_share = 0.25, no_share = 0.75, end_share = 1.0;
/// Points that are drawn of a region, at most so many tries for each, and fewest that are enough; the random
/// stream.
constexpr Index drawn_points = 2000, most_tries = 20, least_points = 500;
constexpr std::uint64_t draw_stream = 7;
/// Places farther from all points than so many spacings of theirs have no share.
constexpr double near_spacings = 4.0;

/// Samples of thin parts beside another one.
std::vector<Index> thin_samples(const SurfaceSamples& samples, const LocalThickness& thickness,
                                double spacing) {
  const double thin = thin_radius * spacing;
  const Points near_places = thickness.thinner_than(thin);
  // Of a shape that is thin as a whole, such as a folded sheet, nothing is finer than the rest.
  if (near_places.rows() == 0 || thickness.median() < thin) return {};
  const Vector away = nearest_distances(near_places, samples.points);
  std::vector<Index> candidates;
  for (Index i = 0; i < samples.size(); ++i)
    if (away[i] < spacing) candidates.push_back(i);
  std::vector<Index> looked = evenly(std::ssize(candidates), most_thin);
  for (Index& row : looked) row = candidates[static_cast<std::size_t>(row)];
  candidates = std::move(looked);
  const Points places = samples.points(candidates, Eigen::all),
               normals = samples.normals(candidates, Eigen::all);
  const double reach = beside * spacing;
  std::vector<char> faces(candidates.size()), is_thin(candidates.size());
  parallel_for(0, places.rows(), 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      bool front = false, back = false;
      for (Index j = 0; j < places.rows() && !(front && back); ++j) {
        const Eigen::RowVector3d way = places.row(j) - places.row(i);
        const double square = way.squaredNorm();
        if (square >= reach * reach || normals.row(i).dot(normals.row(j)) >= opposite_cosine) continue;
        const double ahead = way.dot(normals.row(i)), share = front_cosine * std::sqrt(square);
        front = front || ahead > share;
        back = back || ahead < -share;
      }
      faces[static_cast<std::size_t>(i)] = front;
      is_thin[static_cast<std::size_t>(i)] = back;
    }
  });
  std::vector<Index> result;
  for (std::size_t k = 0; k < candidates.size(); ++k)
    if (faces[k] != 0 && is_thin[k] != 0) result.push_back(candidates[k]);
  return result;
}

/// Single-linkage clusters of points (n,3), in the order of their first ones: rows.
std::vector<std::vector<Index>> clusters(const Points& points, double reach) {
  std::vector<bool> taken(static_cast<std::size_t>(points.rows()));
  std::vector<std::vector<Index>> result;
  for (Index seed = 0; seed < points.rows(); ++seed) {
    if (taken[static_cast<std::size_t>(seed)]) continue;
    taken[static_cast<std::size_t>(seed)] = true;
    std::vector<Index> members{seed};
    for (std::size_t k = 0; k < members.size(); ++k)
      for (Index j = 0; j < points.rows(); ++j)
        if (!taken[static_cast<std::size_t>(j)] &&
            (points.row(j) - points.row(members[k])).squaredNorm() < reach * reach) {
          taken[static_cast<std::size_t>(j)] = true;
          members.push_back(j);
        }
    result.push_back(std::move(members));
  }
  return result;
}

/// The region around thin places: what is connected with them near by. None where hardly any points are
/// found.
std::optional<FineRegion> region_of(const Points& thin, double size, const Points& vertices,
                                    const TriangleMesh& mesh, Random& random) {
  FineRegion result;
  result.ball.center = 0.5 * (thin.colwise().minCoeff() + thin.colwise().maxCoeff()).transpose();
  const double end = end_share * size;
  result.size = size;
  result.ball.radius = 0.5 * size + end;
  const Eigen::RowVector3d middle = result.ball.center.transpose();
  std::vector<Index> near;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return vertices.row(mesh.triangles(t, k)); };
    const Eigen::RowVector3d low = corner(0).cwiseMin(corner(1)).cwiseMin(corner(2)),
                             high = corner(0).cwiseMax(corner(1)).cwiseMax(corner(2));
    const Eigen::RowVector3d gap = (low - middle).cwiseMax(middle - high).cwiseMax(0.0);
    if (gap.norm() < result.ball.radius) near.push_back(t);
  }
  const Triangles triangles = mesh.triangles(near, Eigen::all);
  const std::vector<std::int32_t> pieces = pieces_of({mesh.vertices, triangles});
  const AreaSampler sampler(vertices, triangles);
  Points points(drawn_points, 3), normals(drawn_points, 3);
  std::vector<std::int32_t> piece;
  Index count = 0, tries = 0;
  while (count < drawn_points && tries++ < most_tries * drawn_points) {  // triangles may reach far outside
    const AreaSampler::Draw draw = sampler.draw(random);
    if ((draw.point.transpose() - middle).norm() >= result.ball.radius) continue;
    points.row(count) = draw.point.transpose();
    normals.row(count++) = sampler.unit_normal(draw.triangle).transpose();
    piece.push_back(pieces[static_cast<std::size_t>(draw.triangle)]);
  }
  if (count < least_points) return std::nullopt;
  points.conservativeResize(count, Eigen::NoChange);
  normals.conservativeResize(count, Eigen::NoChange);
  std::vector<bool> is_thin(static_cast<std::size_t>(*std::ranges::max_element(pieces)) + 1);
  for (const std::int32_t row : nearest_samples(points).closest(thin).triangles)
    is_thin[static_cast<std::size_t>(piece[static_cast<std::size_t>(row)])] = true;
  std::vector<Index> rows;
  std::vector<double> shares;
  const Vector away = nearest_distances(thin, points);
  for (Index i = 0; i < count; ++i) {
    if (!is_thin[static_cast<std::size_t>(piece[static_cast<std::size_t>(i)])] || away[i] > end) continue;
    rows.push_back(i);
    shares.push_back(smoothstep(no_share, full_share, away[i] / size));
  }
  if (std::ssize(rows) < least_points) return std::nullopt;
  result.points = points(rows, Eigen::all);
  result.normals = normals(rows, Eigen::all);
  result.nearest_point = std::make_shared<const SignedDistance>(nearest_samples(result.points));
  result.shares = Eigen::Map<const Vector>(shares.data(), std::ssize(shares));
  result.spacing = std::sqrt(sampler.area() / static_cast<double>(std::max(tries, count)));
  return result;
}

}  // namespace

std::vector<Index> BoundingBall::rows_inside(PointsIn points) const {
  std::vector<Index> rows;
  for (Index i = 0; i < points.rows(); ++i)
    if ((points.row(i) - center.transpose()).squaredNorm() < radius * radius) rows.push_back(i);
  return rows;
}

FineRegion FineRegion::reflected(int axis) const {
  FineRegion result = *this;
  result.points.col(axis) *= -1.0;
  result.normals.col(axis) *= -1.0;
  result.ball.center[axis] *= -1.0;
  result.nearest_point = std::make_shared<const SignedDistance>(nearest_samples(result.points));
  return result;
}

std::vector<Index> FineRegion::rows_on(PointsIn places, std::vector<std::int32_t>* nearest) const {
  const std::vector<Index> near = ball.rows_inside(places);
  std::vector<Index> result;
  if (near.empty()) return result;
  const ClosestPoints found = nearest_point->closest(places(near, Eigen::all));
  for (std::size_t k = 0; k < near.size(); ++k) {
    if (!(found.distances[static_cast<Index>(k)] < near_spacings * spacing)) continue;
    result.push_back(near[k]);
    if (nearest != nullptr) nearest->push_back(found.triangles[k]);
  }
  return result;
}

Vector FineRegion::shares_at(PointsIn places) const {
  Vector result = Vector::Zero(places.rows());
  std::vector<std::int32_t> nearest;
  const std::vector<Index> rows = rows_on(places, &nearest);
  for (std::size_t k = 0; k < rows.size(); ++k) result[rows[k]] = shares[nearest[k]];
  return result;
}

std::vector<FineRegion> fine_regions(const SurfaceSamples& samples, const LocalThickness& thickness,
                                     double spacing, const Progress& progress) {
  if (!samples.mesh || samples.normals.rows() != samples.size()) return {};
  const std::vector<Index> thin = thin_samples(samples, thickness, spacing);
  progress.check();
  const Points places = samples.points(thin, Eigen::all);
  const double extent = diagonal_of(samples.points);
  Random random(0, draw_stream);
  std::vector<FineRegion> result;
  Points vertices(0, 3);
  for (const std::vector<Index>& cluster : clusters(places, beside * spacing)) {
    const Points own = places(cluster, Eigen::all);
    const double size = diagonal_of(own);
    if (std::ssize(cluster) < least_thin || size > largest_share * extent) continue;
    if (vertices.rows() == 0) vertices = samples.frame.to_cube(samples.mesh->vertices);
    if (auto region = region_of(own, size, vertices, *samples.mesh, random))
      result.push_back(std::move(*region));
    progress.check();
  }
  return result;
}

}  // namespace arapfields
