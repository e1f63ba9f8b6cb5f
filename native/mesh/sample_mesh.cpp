// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/sample_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/point_grid.h"
#include "mesh/outward_triangles.h"

namespace arapfields {
namespace {

constexpr Index grain = 4096;
/// Beyond it a sample would drown all others in rounding.
constexpr double most_weight = 1e9;
/// How far from the samples a mesh has nothing, in their spacings: chance leaves no such gaps.
constexpr double widest_gap = 3.0;
/// One sample of so many, at most, goes to what the others miss.
constexpr Index least_share = 8;

Vec3 corner(const Points& vertices, const Triangles& triangles, Index t, int k) {
  return vertices.row(triangles(t, k)).transpose();
}

/// One or several meshes' triangles, and where they lie in the cube.
struct Joined {
  TriangleMesh mesh;
  VertexWeights painted;
  Frame frame;
  std::vector<Index> ends;  // of each mesh's triangles; empty for a single mesh
  Vector sheet_sizes = {};  // of the triangles, in mesh units; empty: there are no open sheets
};

/// Painted weights at drawn points; none where all are 1, so that they cost and change nothing.
Vector at_draws(const Vector& painted, const Triangles& triangles,
                const std::vector<AreaSampler::Draw>& draws) {
  if (painted.size() == 0 || (painted.array() == 1.0).all()) return {};
  Vector result(static_cast<Index>(draws.size()));
  for (Index i = 0; i < result.size(); ++i) {
    const AreaSampler::Draw& draw = draws[i];
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) sum += draw.corners[k] * painted[triangles(draw.triangle, k)];
    result[i] = sum;
  }
  return result;
}

/// `whole`: the last ones lie on what all others miss.
SurfaceSamples draw_from(Joined joined, Index count, std::uint64_t seed, bool whole) {
  require(count > 0, "count", std::to_string(count), "at least 1 is needed");
  require_memory("count", 20.0 * sizeof(double) * static_cast<double>(count));
  SurfaceSamples samples;
  samples.frame = joined.frame;
  const AreaSampler sampler(joined.frame.to_cube(joined.mesh.vertices), joined.mesh.triangles);
  samples.points.resize(count, 3);
  samples.normals.resize(count, 3);
  const bool several = !joined.ends.empty();
  const bool painted = joined.painted.weights.size() > 0 || joined.painted.bend_weights.size() > 0;
  const bool sheets = joined.sheet_sizes.size() > 0;
  std::vector<AreaSampler::Draw> draws(several || painted || sheets ? count : 0);
  parallel_for(0, count, grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Random random(seed, static_cast<std::uint64_t>(i));
      const AreaSampler::Draw draw = sampler.draw(random);
      samples.points.row(i) = draw.point.transpose();
      samples.normals.row(i) = sampler.unit_normal(draw.triangle).transpose();
      if (!draws.empty()) draws[i] = draw;
    }
  });
  std::vector<AreaSampler::Draw> missed;
  if (whole)
    missed =
        sampler.missed(samples.points, widest_gap * std::sqrt(sampler.area() / static_cast<double>(count)),
                       count / least_share);
  for (Index i = count - std::ssize(missed); i < count; ++i) {
    const AreaSampler::Draw draw = missed[static_cast<std::size_t>(count - 1 - i)];
    samples.points.row(i) = draw.point.transpose();
    samples.normals.row(i) = sampler.unit_normal(draw.triangle).transpose();
    if (!draws.empty()) draws[i] = draw;
  }
  samples.weights = at_draws(joined.painted.weights, joined.mesh.triangles, draws);
  samples.bend_weights = at_draws(joined.painted.bend_weights, joined.mesh.triangles, draws);
  for (Index i = 0; i < count && several; ++i) {
    const auto mesh_end = std::upper_bound(joined.ends.begin(), joined.ends.end(), draws[i].triangle);
    samples.mesh_indices.push_back(static_cast<std::int32_t>(mesh_end - joined.ends.begin()));
  }
  if (sheets) {
    samples.sheet_sizes.resize(count);
    for (Index i = 0; i < count; ++i)
      samples.sheet_sizes[i] = joined.sheet_sizes[draws[i].triangle] / joined.frame.scale;
  }
  const auto kept = std::make_shared<const Joined>(std::move(joined));
  samples.mesh = {kept, &kept->mesh};
  samples.redraw = [kept](Index again, std::uint64_t other) { return draw_from(*kept, again, other, false); };
  return samples;
}

}  // namespace

AreaSampler::AreaSampler(PointsIn vertices, TrianglesIn triangles)
    : vertices_(vertices), triangles_(triangles) {
  validate(vertices_, triangles_);
  cumulative_.resize(triangles_.rows());
  double total = 0.0;
  for (Index t = 0; t < triangles_.rows(); ++t) {
    const Vec3 a = corner(vertices_, triangles_, t, 0);
    total +=
        0.5 * (corner(vertices_, triangles_, t, 1) - a).cross(corner(vertices_, triangles_, t, 2) - a).norm();
    cumulative_[t] = total;
  }
  require(std::isfinite(total) && total > 0.0, "triangles", "their total area is " + std::to_string(total),
          "points can be drawn only from a finite area above zero");
}

AreaSampler::Draw AreaSampler::draw(Random& random) const {
  const double target = random.uniform() * cumulative_.back();
  auto triangle = std::upper_bound(cumulative_.begin(), cumulative_.end(), target);
  if (triangle == cumulative_.end()) --triangle;
  const Index t = triangle - cumulative_.begin();
  // Uniform in the triangle: the square root makes the distance to corner 0 grow with the area.
  const double root = std::sqrt(random.uniform()), split = random.uniform();
  return {(1.0 - root) * corner(vertices_, triangles_, t, 0) +
              root * (1.0 - split) * corner(vertices_, triangles_, t, 1) +
              root * split * corner(vertices_, triangles_, t, 2),
          t,
          {1.0 - root, root * (1.0 - split), root * split}};
}

Vec3 AreaSampler::unit_normal(Index triangle) const {
  const Vec3 a = corner(vertices_, triangles_, triangle, 0);
  return (corner(vertices_, triangles_, triangle, 1) - a)
      .cross(corner(vertices_, triangles_, triangle, 2) - a)
      .stableNormalized();
}

std::vector<AreaSampler::Draw> AreaSampler::missed(PointsIn points, double reach, Index most) const {
  Points all(points.rows() + vertices_.rows(), 3);
  all << points, vertices_;
  const PointGrid grid(all, reach);
  const std::vector<Index> cells = grid.cell_of_each();
  std::vector<bool> covered(static_cast<std::size_t>(grid.size()));
  for (Index cell = 0; cell < grid.size(); ++cell)
    covered[static_cast<std::size_t>(cell)] = grid.rows(cell).front() < points.rows();  // rows ascend
  const auto is_near = [&](Index row) {
    bool near = false;
    grid.near(cells[static_cast<std::size_t>(row)], [&](Index cell) {
      for (const Index i : grid.rows(cell))
        near = near || (i < points.rows() && (all.row(i) - all.row(row)).squaredNorm() < reach * reach);
    });
    return near;
  };
  std::vector<Draw> found;
  for (Index t = 0; t < triangles_.rows(); ++t)
    for (int k = 0; k < 3 && std::ssize(found) < most; ++k) {
      const Index row = points.rows() + triangles_(t, k), cell = cells[static_cast<std::size_t>(row)];
      if (covered[static_cast<std::size_t>(cell)] || is_near(row) || unit_normal(t).isZero()) continue;
      found.push_back({corner(vertices_, triangles_, t, k), t, Vec3::Unit(k)});
      grid.near(cell, [&](Index other) { covered[static_cast<std::size_t>(other)] = true; });
    }
  return found;
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

void require_weights(const std::string& argument, const Vector& weights, Index count) {
  if (weights.size() == 0) return;
  require(weights.size() == count, argument, std::to_string(weights.size()) + " numbers",
          std::to_string(count) + ", or none, are needed");
  require(weights.allFinite() && weights.minCoeff() >= 0.0 && weights.maxCoeff() <= most_weight, argument,
          "some are negative, too large or not finite", "all must be from 0 to " + number_text(most_weight));
}

SurfaceSamples sample_mesh(PointsIn vertices, TrianglesIn triangles, Index count, std::uint64_t seed,
                           const VertexWeights& painted) {
  require_weights("weights", painted.weights, vertices.rows());
  require_weights("bend_weights", painted.bend_weights, vertices.rows());
  const Frame frame = area_frame(vertices, triangles);
  Joined joined{{vertices, {}}, painted, frame, {}};
  joined.mesh.triangles = outward_triangles({vertices, triangles}, &joined.sheet_sizes);
  if (!(joined.sheet_sizes.array() > 0.0).any()) joined.sheet_sizes.resize(0);
  return draw_from(std::move(joined), count, seed, true);
}

SurfaceSamples sample_meshes(const std::vector<TriangleMesh>& meshes, Index count, std::uint64_t seed,
                             const std::vector<VertexWeights>& painted) {
  require(!meshes.empty(), "meshes", "there are none", "at least one is needed");
  require(painted.empty() || painted.size() == meshes.size(), "weights", std::to_string(painted.size()),
          "one for each of the " + std::to_string(meshes.size()) + " meshes, or none, is needed");
  Joined all;
  Index vertices = 0, triangles = 0;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const std::string name = std::string("meshes[").append(std::to_string(i)).append("]");
    try {
      validate(meshes[i]);
      if (i == 0) all.frame = area_frame(meshes[i].vertices, meshes[i].triangles);
    } catch (const InvalidInput& error) {
      throw InvalidInput(name + ": " + error.what());
    }
    if (!painted.empty()) {
      require_weights(name + ".weights", painted[i].weights, meshes[i].vertices.rows());
      require_weights(name + ".bend_weights", painted[i].bend_weights, meshes[i].vertices.rows());
    }
    vertices += meshes[i].vertices.rows();
    triangles += meshes[i].triangles.rows();
    all.ends.push_back(triangles);
  }
  require(vertices <= INT32_MAX && triangles <= INT32_MAX, "meshes", "too many vertices or triangles in all",
          "32-bit indices reach no farther");
  all.mesh.vertices.resize(vertices, 3);
  all.mesh.triangles.resize(triangles, 3);
  all.painted = {Vector::Ones(painted.empty() ? 0 : vertices), Vector::Ones(painted.empty() ? 0 : vertices)};
  all.sheet_sizes.resize(triangles);
  Index v = 0, t = 0;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const TriangleMesh& mesh = meshes[i];
    all.mesh.vertices.middleRows(v, mesh.vertices.rows()) = mesh.vertices;
    Vector sheet_sizes;
    all.mesh.triangles.middleRows(t, mesh.triangles.rows()) =
        outward_triangles(mesh, &sheet_sizes).array() + static_cast<int>(v);
    all.sheet_sizes.segment(t, mesh.triangles.rows()) = sheet_sizes;
    if (!painted.empty()) {
      if (painted[i].weights.size() > 0)
        all.painted.weights.segment(v, mesh.vertices.rows()) = painted[i].weights;
      if (painted[i].bend_weights.size() > 0)
        all.painted.bend_weights.segment(v, mesh.vertices.rows()) = painted[i].bend_weights;
    }
    v += mesh.vertices.rows();
    t += mesh.triangles.rows();
  }
  if (!(all.sheet_sizes.array() > 0.0).any()) all.sheet_sizes.resize(0);
  return draw_from(std::move(all), count, seed, true);
}

}  // namespace arapfields
