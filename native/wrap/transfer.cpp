// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/transfer.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <mutex>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/signed_distance.h"
#include "distance/welded_vertices.h"
#include "mesh/is_closed.h"
#include "mesh/outward_triangles.h"
#include "sampling/oriented_points.h"
#include "wrap/carried_motion.h"

namespace arapfields {
namespace {

/// Fractions of the bounding box's diagonal: the distance that a difference of unit normals of 1 counts as,
/// and the largest distance of a point with a matching normal. Wraps are much nearer; scans' normals may err.
constexpr double turn_share = 0.1, thin_share = 0.01;

/// The edges of a triangle from its first corner, and its normal times twice its area.
struct TriangleEdges {
  TriangleEdges(PointsIn vertices, TrianglesIn triangles, Index t)
      : origin(vertices.row(triangles(t, 0))),
        first(vertices.row(triangles(t, 1)).transpose() - origin),
        second(vertices.row(triangles(t, 2)).transpose() - origin),
        area(first.cross(second)) {}

  /// Barycentric coordinates of the triangle's closest point (Ericson 2004, section 5.1.5).
  Vec3 nearest(const Vec3& point) const {
    const Vec3 a = point - origin, b = a - first, c = a - second;
    const double d1 = first.dot(a), d2 = second.dot(a), d3 = first.dot(b), d4 = second.dot(b);
    const double d5 = first.dot(c), d6 = second.dot(c);
    if (d1 <= 0.0 && d2 <= 0.0) return {1.0, 0.0, 0.0};
    if (d3 >= 0.0 && d4 <= d3) return {0.0, 1.0, 0.0};
    if (d6 >= 0.0 && d5 <= d6) return {0.0, 0.0, 1.0};
    const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    const auto along = [](double part, double whole) { return whole > 0.0 ? part / whole : 0.0; };
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
      const double t = along(d1, d1 - d3);
      return {1.0 - t, t, 0.0};
    }
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
      const double t = along(d2, d2 - d6);
      return {1.0 - t, 0.0, t};
    }
    if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
      const double t = along(d4 - d3, (d4 - d3) + (d5 - d6));
      return {0.0, 1.0 - t, t};
    }
    const double sum = va + vb + vc;
    if (!(sum > 0.0)) return {1.0, 0.0, 0.0};
    return {1.0 - (vb + vc) / sum, vb / sum, vc / sum};
  }
  Vec3 at(const Vec3& shares) const { return origin + shares[1] * first + shares[2] * second; }

  Vec3 origin, first, second, area;
};

/// The triangles around each vertex, with vertices welded by position.
class Surroundings {
 public:
  explicit Surroundings(const TriangleMesh& mesh)
      : triangles_(mesh.triangles), first_(first_at_position(mesh.vertices)), about_(first_.size()) {
    for (Index t = 0; t < triangles_.rows(); ++t)
      for (int k = 0; k < 3; ++k) about_[first_[triangles_(t, k)]].push_back(static_cast<std::int32_t>(t));
  }
  template <class Visit>
  void visit(Index triangle, Visit&& visit) const {
    for (int k = 0; k < 3; ++k)
      for (const std::int32_t t : about_[first_[triangles_(triangle, k)]]) visit(t);
  }

 private:
  const Triangles& triangles_;
  std::vector<std::int32_t> first_;
  std::vector<std::vector<std::int32_t>> about_;
};

RowMatrix<double> values_at(const SurfacePlaces& places, const Triangles& triangles,
                            const Eigen::Ref<const RowMatrix<double>>& given) {
  RowMatrix<double> result(places.shares.rows(), given.cols());
  parallel_for(0, result.rows(), 4096, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      result.row(i) = places.interpolated(triangles, i, [&](Index v) { return given.row(v); });
  });
  return result;
}

/// The displacement map at the receiving vertices, whose places lie on the source.
DisplacementMap displacement_map(const WrappedMesh& source, const SurfacePlaces& places, bool back,
                                 const Progress& progress) {
  SmoothMap map = surface_map(source.rest, source.moved.vertices, progress);
  if (back)
    return {std::move(map), source.rest.vertices, source.moved.vertices, source.jacobians, back, progress};
  const Triangles& triangles = source.rest.triangles;
  std::vector<Mat3> jacobians(places.shares.rows());
  for (Index i = 0; i < places.shares.rows(); ++i)
    jacobians[i] =
        places.interpolated(triangles, i, [&](Index v) -> const Mat3& { return source.jacobians[v]; });
  return {std::move(map),
          Points(values_at(places, triangles, source.rest.vertices)),
          Points(values_at(places, triangles, source.moved.vertices)),
          std::move(jacobians),
          back,
          progress};
}

Points moved_by(const DeformationField& field, const TriangleMesh& mesh) {
  validate(mesh);
  return field.at(mesh.vertices);
}

}  // namespace

SurfacePlaces places_on(const TriangleMesh& mesh, PointsIn points, PointsIn normals,
                        const Progress& progress) {
  const Index count = points.rows();
  ClosestPoints closest = SignedDistance(mesh.vertices, mesh.triangles, progress).closest(points, progress);
  SurfacePlaces places{std::move(closest.triangles), Points(count, 3), std::move(closest.distances)};
  const auto edges_of = [&](Index t) { return TriangleEdges(mesh.vertices, mesh.triangles, t); };

  // The other side of thin parts: the nearest triangle by position and normal, then the best around it.
  std::vector<Index> doubtful;
  for (Index i = 0; i < count; ++i)
    if (edges_of(places.triangles[i]).area.dot(normals.row(i)) < 0.0) doubtful.push_back(i);
  if (!doubtful.empty()) {
    Points centers(mesh.triangles.rows(), 3), facing(mesh.triangles.rows(), 3);
    for (Index t = 0; t < centers.rows(); ++t) {
      centers.row(t) = edges_of(t).at(Vec3::Constant(1.0 / 3.0));
      facing.row(t) = edges_of(t).area.normalized();
    }
    const double diagonal = diagonal_of(mesh.vertices);
    const std::vector<Index> near =
        OrientedPoints(centers, facing)
            .nearest(points(doubtful, Eigen::all), normals(doubtful, Eigen::all), turn_share * diagonal);
    const Surroundings surroundings(mesh);
    for (std::size_t k = 0; k < doubtful.size(); ++k) {
      const Index i = doubtful[k];
      const Vec3 point = points.row(i), normal = normals.row(i);
      double least = thin_share * diagonal;
      surroundings.visit(near[k], [&](std::int32_t t) {
        const TriangleEdges edges = edges_of(t);
        const double distance = (edges.at(edges.nearest(point)) - point).norm();
        if (!(edges.area.dot(normal) > 0.0 && distance < least)) return;
        least = places.distances[i] = distance;
        places.triangles[i] = t;
      });
      if (k % 1024 == 0) progress.check();
    }
  }
  for (Index i = 0; i < count; ++i)
    places.shares.row(i) = edges_of(places.triangles[i]).nearest(points.row(i));
  return places;
}

WrappedMesh::WrappedMesh(const TriangleMesh& source, const DeformationField& field)
    : WrappedMesh(source, moved_by(field, source)) {}

WrappedMesh::WrappedMesh(const TriangleMesh& source, PointsIn positions)
    : rest(facing_outwards(source)),
      moved{positions, rest.triangles},
      jacobians(positions.rows(), Mat3::Zero()) {
  require(positions.rows() == source.vertices.rows(), "field",
          std::to_string(positions.rows()) + " moved vertices", "one for each of the source is needed");
  validate(moved);
  const std::vector<std::int32_t> first = first_at_position(source.vertices);
  std::vector<double> areas(jacobians.size(), 0.0);
  const auto basis = [](const TriangleEdges& edges) {
    Mat3 columns;
    columns << edges.first, edges.second, edges.area / std::sqrt(edges.area.norm());
    return columns;
  };
  for (Index t = 0; t < rest.triangles.rows(); ++t) {
    const TriangleEdges before(rest.vertices, rest.triangles, t), now(positions, rest.triangles, t);
    const double area = before.area.norm();
    if (!(area > 0.0 && now.area.norm() > 0.0)) continue;
    const Mat3 gradient = basis(now) * basis(before).inverse();
    if (!gradient.allFinite()) continue;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = first[rest.triangles(t, k)];
      jacobians[v] += area * gradient;
      areas[v] += area;
    }
  }
  for (std::size_t v = 0; v < areas.size(); ++v)
    if (areas[v] > 0.0)
      jacobians[v] /= areas[v];
    else if (first[v] == static_cast<std::int32_t>(v))
      jacobians[v].setIdentity();
  for (std::size_t v = 0; v < areas.size(); ++v) jacobians[v] = jacobians[first[v]];
}

/// The factored system of displacements(), made at its first call.
struct Correspondence::Motion {
  Motion(const WrappedMesh& wrapped, bool is_back) : source(wrapped), back(is_back) {}

  WrappedMesh source;
  bool back;
  std::mutex mutex;
  std::optional<CarriedMotion> carried;
};

Correspondence::Correspondence(const WrappedMesh& source, const TriangleMesh& given_target,
                               Direction direction, const Progress& progress)
    : motion_(std::make_shared<Motion>(source, direction == Direction::to_source)) {
  const TriangleMesh target = facing_outwards(given_target);
  const bool forward = direction == Direction::to_target;
  giving_ = forward ? source.rest : target;
  receiving_ = forward ? target : source.rest;
  const TriangleMesh &on = forward ? source.moved : target, &points = forward ? target : source.moved;
  const WeldedVertices welded(points);
  places_ = places_on(on, points.vertices, welded.normals(welded.first, Eigen::all), progress);
  if (forward) return;
  for (const Mat3& jacobian : source.jacobians)
    require(jacobian.determinant() != 0.0, "field", "the wrap flattens a vertex of the source",
            "each must keep a volume about it for the way back");
}

RowMatrix<double> Correspondence::values(const RowMatrix<double>& given) const {
  require(given.rows() == giving(), "values", std::to_string(given.rows()) + " rows",
          "one for each of " + std::to_string(giving()) + " vertices is needed");
  return values_at(places_, giving_.triangles, given);
}

Points Correspondence::displacements(PointsIn given, const Progress& progress) const {
  require(given.rows() == giving(), "displacements", std::to_string(given.rows()) + " rows",
          "one for each of " + std::to_string(giving()) + " vertices is needed");
  {
    const std::lock_guard lock(motion_->mutex);
    Motion& motion = *motion_;
    if (!motion.carried)
      motion.carried.emplace(giving_, receiving_, places_,
                             displacement_map(motion.source, places_, motion.back, progress), progress);
  }
  return (*motion_->carried)(given, progress);
}

}  // namespace arapfields
