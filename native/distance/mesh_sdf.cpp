// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/mesh_sdf.h"

#include <Eigen/Geometry>

#include "core/parallel.h"
#include "mesh/outward_triangles.h"
#include "mesh/sample_mesh.h"

namespace arapfields {
namespace {

// Relative to the frame's scale: at smaller distances the direction to the triangle is lost in rounding.
constexpr double on_surface = 1e-12;
constexpr Index points_a_task = 1024;

Points unit_normals(PointsIn vertices, TrianglesIn triangles) {
  Points normals(triangles.rows(), 3);
  for (Index t = 0; t < triangles.rows(); ++t) {
    const Vec3 a = vertices.row(triangles(t, 0)), b = vertices.row(triangles(t, 1)),
               c = vertices.row(triangles(t, 2));
    normals.row(t) = (b - a).cross(c - a).stableNormalized();
  }
  return normals;
}

}  // namespace

MeshSdf::MeshSdf(PointsIn vertices, TrianglesIn triangles, const Progress& progress)
    : frame_(mesh_frame(vertices, triangles)),
      vertices_(vertices),
      triangles_(outward_triangles({vertices, triangles})),
      distance_(vertices_, triangles_, progress),
      normals_(unit_normals(frame_.to_cube(vertices_), triangles_)) {}

Vector MeshSdf::evaluate(PointsIn points, Points* gradients, const Progress& progress) const {
  Vector distances(points.rows());
  if (gradients == nullptr) {
    distance_.evaluate(points, distances, progress);
    return distances;
  }
  const ClosestPoints closest = distance_.evaluate_closest(points, distances, progress);
  gradients->resize(points.rows(), 3);
  parallel_for(0, points.rows(), points_a_task, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 offset = (points.row(i) - closest.points.row(i)) / frame_.scale;
      if (offset.norm() > on_surface)
        gradients->row(i) = (distances[i] < 0.0 ? -1.0 : 1.0) * offset.normalized();
      else
        gradients->row(i) = normals_.row(closest.triangles[i]);
    }
  });
  return distances;
}

void MeshSdf::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const {
  values = (evaluate(frame_.to_mesh(points.cast<double>()), nullptr, {}) / frame_.scale).cast<float>();
}

void MeshSdf::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                       Eigen::Ref<PointsF> gradients) const {
  Points slopes;
  values = (evaluate(frame_.to_mesh(points.cast<double>()), &slopes, {}) / frame_.scale).cast<float>();
  gradients = slopes.cast<float>();
}

Vector MeshSdf::distances(PointsIn points, const Progress& progress) const {
  return evaluate(points, nullptr, progress);
}

Points MeshSdf::gradients(PointsIn points, const Progress& progress) const {
  Points result;
  evaluate(points, &result, progress);
  return result;
}

}  // namespace arapfields
