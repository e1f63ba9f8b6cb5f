// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/target.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/mesh_sdf.h"
#include "mesh/sample_mesh.h"
#include "sampling/sample_surface.h"

namespace arapfields {
namespace {

/// Neighbours that a point is compared with lie within so many spacings: some twenty of them.
constexpr double neighbourhood = 2.5;
/// A gap between their directions from which on the surface ends there.
constexpr double widest_gap = 2.4;
/// Points at which the spacing is looked at.
constexpr Index spacing_points = 200;

SurfaceSamples samples_of(const ImplicitFunction& function, Index count, std::uint64_t seed,
                          const Progress& progress) {
  if (const auto* mesh = dynamic_cast<const MeshSdf*>(&function))
    return sample_mesh(mesh->vertices(), mesh->triangles(), count, seed);
  try {
    return sample_surface(
        function, {.count = static_cast<int>(count), .seed = static_cast<std::int64_t>(seed)}, progress);
  } catch (const InvalidInput& error) {
    throw InvalidInput(std::string("target: ") + error.what());
  }
}

/// 0 where the directions of the neighbours leave a wide gap: beside a border.
double wholeness(const WrapTarget& target, Index i) {
  const Vec3 place = target.points.row(i), normal = target.normals.row(i);
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<double> angles;
  for (const Index k : target.tree.within(place, neighbourhood * target.spacing)) {
    const Vec3 way = target.points.row(k).transpose() - place;
    if (k == i || target.normals.row(k).dot(normal) < 0.0) continue;
    angles.push_back(std::atan2(way.dot(v), way.dot(u)));
  }
  if (angles.empty()) return 0.0;
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2.0 * std::numbers::pi - angles.back();
  for (std::size_t k = 1; k < angles.size(); ++k) gap = std::max(gap, angles[k] - angles[k - 1]);
  return gap > widest_gap ? 0.0 : 1.0;
}

}  // namespace

Points Similarity::of(PointsIn points) const {
  return (points * (scale * rotation.transpose())).rowwise() + translation.transpose();
}

Points Similarity::inverse_of(PointsIn points) const {
  return (points.rowwise() - translation.transpose()) * (rotation / scale);
}

WrapTarget WrapTarget::seen_from(const Similarity& placement) const {
  WrapTarget result;
  result.points = placement.inverse_of(points);
  result.normals = normals * placement.rotation;
  result.whole = whole;
  result.closed = closed;
  result.spacing = spacing / placement.scale;
  result.diagonal = diagonal / placement.scale;
  result.tree = OrientedPoints(result.points, result.normals);
  return result;
}

WrapTarget WrapTarget::thinned(Index count) const {
  const Index all = points.rows(), taken = std::min(count, all);
  WrapTarget result = *this;
  result.points.resize(taken, 3);
  result.normals.resize(taken, 3);
  result.whole.resize(taken);
  for (Index i = 0; i < taken; ++i) {  // they are in random order
    result.points.row(i) = points.row(i);
    result.normals.row(i) = normals.row(i);
    result.whole[i] = whole[i];
  }
  result.spacing = spacing * std::sqrt(static_cast<double>(all) / static_cast<double>(taken));
  result.tree = OrientedPoints(result.points, result.normals);
  return result;
}

double mean_spacing(PointsIn points) {
  const Index n = points.rows(), taken = std::min(n, spacing_points);
  if (n < 2) return 0.0;
  double sum = 0.0;
  for (Index k = 0; k < taken; ++k) {
    const Index i = k * n / taken;
    Vector squares = (points.rowwise() - points.row(i)).rowwise().squaredNorm();
    squares[i] = squares.maxCoeff();
    sum += std::sqrt(squares.minCoeff());
  }
  return 2.0 * sum / static_cast<double>(taken);  // of random points the nearest lies half a spacing away
}

WrapTarget wrap_target(const ImplicitFunction& function, Index count, std::uint64_t seed,
                       const Progress& progress) {
  const SurfaceSamples samples = samples_of(function, count, seed, progress);
  WrapTarget target;
  target.points = samples.frame.to_mesh(samples.points);
  target.normals = samples.normals;
  for (Index i = 0; i < target.normals.rows(); ++i)  // of triangles without area
    if (!(target.normals.row(i).squaredNorm() > 0.5)) target.normals.row(i) = Vec3::UnitZ().transpose();
  target.diagonal = (target.points.colwise().maxCoeff() - target.points.colwise().minCoeff()).norm();
  target.spacing = mean_spacing(target.points);
  target.tree = OrientedPoints(target.points, target.normals);
  target.whole = Vector::Ones(target.points.rows());
  if (function.continuous()) return target;
  parallel_for(0, target.points.rows(), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) target.whole[i] = wholeness(target, i);
  });
  target.closed = false;
  progress.check();
  return target;
}

SurfaceDistances surface_distances(const OrientedPoints& tree, PointsIn points, PointsIn normals,
                                   double spacing, PointsIn others, PointsIn other_normals,
                                   const Vector& areas, const Vector& whole) {
  const std::vector<Index> nearest = tree.nearest(others, other_normals, 0.0);
  std::vector<std::pair<double, double>> told;  // distances with areas
  double area = 0.0, sum = 0.0;
  for (Index i = 0; i < others.rows(); ++i) {
    const Index k = nearest[static_cast<std::size_t>(i)];
    if (whole.size() > 0 && whole[k] == 0.0) continue;
    const Vec3 way = others.row(i) - points.row(k), normal = normals.row(k);
    const double across = way.dot(normal);
    const double along = std::max(0.0, (way - across * normal).norm() - spacing);
    told.emplace_back(std::hypot(across, along), areas.size() > 0 ? areas[i] : 1.0);
    area += told.back().second;
    sum += told.back().first * told.back().second;
  }
  SurfaceDistances result;
  if (!(area > 0.0)) return result;
  result.mean = sum / area;
  std::sort(told.begin(), told.end());
  double covered = 0.0;
  for (const auto& [distance, share] : told) {
    result.most_95 = distance;
    if ((covered += share) >= 0.95 * area) break;
  }
  return result;
}

}  // namespace arapfields
