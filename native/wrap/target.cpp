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
#include "wrap/parameters.h"
#include "wrap/scan_noise.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

SurfaceSamples samples_of(const ImplicitFunction& function, Index count, std::uint64_t seed,
                          const Progress& progress) {
  if (const auto* mesh = dynamic_cast<const MeshSdf*>(&function))
    return sample_mesh(without_noise({mesh->vertices(), mesh->triangles()}), mesh->triangles(), count, seed);
  try {
    return sample_surface(
        function, {.count = static_cast<int>(count), .seed = static_cast<std::int64_t>(seed)}, progress);
  } catch (const InvalidInput& error) {
    throw InvalidInput(std::string("target: ") + error.what());
  }
}

/// Whether the directions to a point's neighbours leave no wide gap in its tangent plane.
bool is_interior(const WrapTarget& target, Index i) {
  const Vec3 point = target.points.row(i), normal = target.normals.row(i);
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<double> angles;
  for (const Index k : target.tree.within(point, neighbourhood_spacings * target.spacing)) {
    const Vec3 offset = target.points.row(k).transpose() - point;
    if (k == i || target.normals.row(k).dot(normal) < 0.0) continue;
    angles.push_back(std::atan2(offset.dot(v), offset.dot(u)));
  }
  if (angles.empty()) return false;
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2.0 * std::numbers::pi - angles.back();
  for (std::size_t k = 1; k < angles.size(); ++k) gap = std::max(gap, angles[k] - angles[k - 1]);
  return gap <= border_gap;
}

}  // namespace

Points Similarity::of(PointsIn points) const {
  return (points * (scale * rotation.transpose())).rowwise() + translation.transpose();
}

Points Similarity::inverse_of(PointsIn points) const {
  return (points.rowwise() - translation.transpose()) * (rotation / scale);
}

WrapTarget WrapTarget::transformed_back(const Similarity& placement) const {
  WrapTarget result;
  result.points = placement.inverse_of(points);
  result.normals = normals * placement.rotation;
  result.interior = interior;
  result.closed = closed;
  result.spacing = spacing / placement.scale;
  result.diagonal = diagonal / placement.scale;
  result.tree = OrientedPoints(result.points, result.normals);
  return result;
}

WrapTarget WrapTarget::subsample(Index count) const {
  const Index all = points.rows(), taken = std::min(count, all);
  WrapTarget result = *this;
  result.points = points.topRows(taken);
  result.normals = normals.topRows(taken);
  result.interior = interior.head(taken);
  if (curvature.values.size() > 0)
    result.curvature = {curvature.radius, curvature.values.topRows(taken),
                        curvature.gradients.topRows(taken)};
  result.spacing = spacing * std::sqrt(static_cast<double>(all) / static_cast<double>(taken));
  result.tree = OrientedPoints(result.points, result.normals);
  return result;
}

SurfaceCurvature curvature_of(const ImplicitFunction& function, const WrapTarget& target,
                              const Similarity& placement, std::uint64_t seed, const Progress& progress) {
  const SurfaceSamples samples = samples_of(function, curvature_samples, seed, progress);
  const Points points = placement.inverse_of(samples.frame.to_mesh(samples.points)),
               normals = samples.normals * placement.rotation;
  return curvature_at(points, normals, target.points, target.normals, curvature_radius * target.diagonal,
                      progress);
}

double mean_spacing(PointsIn points) {
  const Index n = points.rows(), taken = std::min(n, spacing_samples);
  if (n < 2) return 0.0;
  double sum = 0.0;
  for (Index k = 0; k < taken; ++k) {
    const Index i = k * n / taken;
    Vector squares = (points.rowwise() - points.row(i)).rowwise().squaredNorm();
    squares[i] = squares.maxCoeff();
    sum += std::sqrt(squares.minCoeff());
  }
  return 2.0 * sum / static_cast<double>(taken);  // random points' nearest neighbour is half a spacing away
}

WrapTarget wrap_target(const ImplicitFunction& function, Index count, std::uint64_t seed,
                       const Progress& progress) {
  const SurfaceSamples samples = samples_of(function, count, seed, progress);
  WrapTarget target;
  target.points = samples.frame.to_mesh(samples.points);
  target.normals = samples.normals;
  for (Index i = 0; i < target.normals.rows(); ++i)  // of triangles without area
    if (!(target.normals.row(i).squaredNorm() > 0.5)) target.normals.row(i) = Vec3::UnitZ().transpose();
  target.diagonal = diagonal_of(target.points);
  require(std::isfinite(target.points.squaredNorm()), "target", "its coordinates are too large",
          "their squares must be finite");
  target.spacing = mean_spacing(target.points);
  target.tree = OrientedPoints(target.points, target.normals);
  target.interior = Vector::Ones(target.points.rows());
  if (function.continuous()) return target;
  parallel_for(0, target.points.rows(), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) target.interior[i] = is_interior(target, i) ? 1.0 : 0.0;
  });
  target.closed = false;
  progress.check();
  return target;
}

SurfaceDistances surface_distances(const OrientedPoints& tree, PointsIn points, PointsIn normals,
                                   double spacing, PointsIn queries, PointsIn query_normals,
                                   const Vector& areas, const Vector& interior) {
  const std::vector<Index> nearest = tree.nearest(queries, query_normals, 0.0);
  std::vector<std::pair<double, double>> distances;  // each with its area
  double area = 0.0, sum = 0.0;
  for (Index i = 0; i < queries.rows(); ++i) {
    const Index k = nearest[i];
    if (interior.size() > 0 && interior[k] == 0.0) continue;
    const Vec3 offset = queries.row(i) - points.row(k), normal = normals.row(k);
    const double across = offset.dot(normal);
    const double along = std::max(0.0, (offset - across * normal).norm() - spacing);
    distances.emplace_back(std::hypot(across, along), areas.size() > 0 ? areas[i] : 1.0);
    area += distances.back().second;
    sum += distances.back().first * distances.back().second;
  }
  SurfaceDistances result;
  if (!(area > 0.0)) return result;
  result.mean = sum / area;
  std::sort(distances.begin(), distances.end());
  double covered = 0.0;
  for (const auto& [distance, part] : distances) {
    result.quantile_95 = distance;
    if ((covered += part) >= 0.95 * area) break;
  }
  return result;
}

}  // namespace arapfields
