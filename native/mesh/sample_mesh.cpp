// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/sample_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr Index grain = 4096;

Vec3 corner(const Points& vertices, const Triangles& triangles, Index t, int k) {
  return vertices.row(triangles(t, k)).transpose();
}

}  // namespace

AreaSampler::AreaSampler(PointsIn vertices, TrianglesIn triangles)
    : vertices_(vertices), triangles_(triangles) {
  validate(vertices_, triangles_);
  cumulative_.resize(static_cast<std::size_t>(triangles_.rows()));
  double total = 0.0;
  for (Index t = 0; t < triangles_.rows(); ++t) {
    const Vec3 a = corner(vertices_, triangles_, t, 0);
    total +=
        0.5 * (corner(vertices_, triangles_, t, 1) - a).cross(corner(vertices_, triangles_, t, 2) - a).norm();
    cumulative_[static_cast<std::size_t>(t)] = total;
  }
  require(std::isfinite(total) && total > 0.0, "triangles", "their total area is " + std::to_string(total),
          "points can be drawn only from a finite area above zero");
}

AreaSampler::Draw AreaSampler::draw(Random& random) const {
  const double target = random.uniform() * cumulative_.back();
  auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  if (found == cumulative_.end()) --found;
  const Index t = found - cumulative_.begin();
  // Uniform in the triangle: the square root makes the distance to corner 0 grow with the area.
  const double root = std::sqrt(random.uniform()), split = random.uniform();
  return {(1.0 - root) * corner(vertices_, triangles_, t, 0) +
              root * (1.0 - split) * corner(vertices_, triangles_, t, 1) +
              root * split * corner(vertices_, triangles_, t, 2),
          t};
}

Vec3 AreaSampler::unit_normal(Index triangle) const {
  const Vec3 a = corner(vertices_, triangles_, triangle, 0);
  return (corner(vertices_, triangles_, triangle, 1) - a)
      .cross(corner(vertices_, triangles_, triangle, 2) - a)
      .stableNormalized();
}

Frame area_frame(PointsIn vertices, TrianglesIn triangles) {
  validate(vertices, triangles);
  const Points used = used_vertices(vertices, triangles);
  const Vec3 extent = used.colwise().maxCoeff() - used.colwise().minCoeff();
  require(extent.maxCoeff() > 0.0, "vertices", "all vertices in use are the same point",
          "a mesh must have an extent");
  require(extent.allFinite(), "vertices", "their bounding box is too large for floating point",
          "its sides must be finite");
  // Squares of sides must neither overflow nor vanish.
  const Vec3 origin = 0.5 * used.colwise().minCoeff() + 0.5 * used.colwise().maxCoeff();
  const double unit = extent.maxCoeff();
  const Points placed = (vertices.rowwise() - origin.transpose()) / unit;
  Points centroids(triangles.rows(), 3);
  Vector areas(triangles.rows()), spreads(triangles.rows());
  for (Index t = 0; t < triangles.rows(); ++t) {
    Mat3 corners;
    for (int k = 0; k < 3; ++k) corners.col(k) = placed.row(triangles(t, k)).transpose();
    const Vec3 middle = corners.rowwise().mean();
    centroids.row(t) = middle.transpose();
    areas[t] = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).norm();
    spreads[t] = (corners.colwise() - middle).squaredNorm() / 12.0;
  }
  require(areas.sum() > 0.0, "triangles", "their total area is 0",
          "points can be drawn only from a finite area above zero");
  const Frame frame = Frame::balanced(centroids, areas, spreads);
  return {origin + unit * frame.center, unit * frame.scale};
}

Frame mesh_frame(PointsIn vertices, TrianglesIn triangles) {
  constexpr double largest_radius = 0.93;
  Frame frame = area_frame(vertices, triangles);
  const double radius = (used_vertices(vertices, triangles).rowwise() - frame.center.transpose())
                            .rowwise()
                            .stableNorm()
                            .maxCoeff();
  frame.scale = std::max(frame.scale, radius / largest_radius);
  return frame;
}

SurfaceSamples sample_mesh(PointsIn vertices, TrianglesIn triangles, Index count, std::uint64_t seed) {
  require(count > 0, "count", std::to_string(count), "at least 1 is needed");
  require_memory("count", 6.0 * sizeof(double) * static_cast<double>(count));
  SurfaceSamples samples;
  samples.frame = area_frame(vertices, triangles);
  samples.redraw = [v = Points(vertices), t = Triangles(triangles)](Index again, std::uint64_t other) {
    return sample_mesh(v, t, again, other);
  };
  const AreaSampler sampler(samples.frame.to_cube(vertices), triangles);
  samples.points.resize(count, 3);
  samples.normals.resize(count, 3);
  parallel_for(0, count, grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Random random(seed, static_cast<std::uint64_t>(i));
      const AreaSampler::Draw draw = sampler.draw(random);
      samples.points.row(i) = draw.point.transpose();
      samples.normals.row(i) = sampler.unit_normal(draw.triangle).transpose();
    }
  });
  return samples;
}

}  // namespace arapfields
