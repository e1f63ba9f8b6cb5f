// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/welded_surface.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/parallel.h"
#include "energies/rotation.h"
#include "mesh/is_closed.h"

namespace arapfields {
namespace {

/// Of half a cotangent: thin triangles are as stiff as they are, down to a tenth of a degree.
constexpr double least_cotangent = 1e-3, most_cotangent = 300.0;
/// Twice a triangle's area over its longest edge's square, below which it has none.
constexpr double no_area = 1e-9;
/// Share of the moved mesh's diagonal within which vertices of one rest place have stayed together.
constexpr double together = 1e-6;
constexpr Index surface_grain = 4096;

}  // namespace

WeldedSurface::WeldedSurface(const TriangleMesh& mesh, PointsIn moved) {
  const Index count = mesh.vertices.rows();
  const std::vector<std::int32_t> first = first_at_position(mesh.vertices);
  const double near = together * diagonal_of(moved);

  // The vertex that stands for each: the first at its place that has moved to the same one.
  std::vector<std::int32_t> stands(count), next(count, -1);
  for (Index v = 0; v < count; ++v) {
    std::int32_t other = first[v];
    for (; (moved.row(other) - moved.row(v)).norm() > near; other = next[other])
      if (next[other] < 0) {
        next[other] = static_cast<std::int32_t>(v);
        other = static_cast<std::int32_t>(v);
        break;
      }
    stands[v] = other;
  }

  std::vector<Vec3> cotangents;
  node_of_.assign(count, -1);
  std::vector<std::int32_t> kept;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) -> Vec3 { return mesh.vertices.row(mesh.triangles(t, k % 3)); };
    const double area = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    double longest = 0.0;
    for (int k = 0; k < 3; ++k) longest = std::max(longest, (corner(k + 1) - corner(k)).squaredNorm());
    if (!(area > no_area * longest)) continue;
    Vec3 half;
    for (int k = 0; k < 3; ++k)
      half[k] = std::clamp((corner(k + 1) - corner(k)).dot(corner(k + 2) - corner(k)) / (2.0 * area),
                           least_cotangent, most_cotangent);
    cotangents.push_back(half);
    row_of_.push_back(static_cast<std::int32_t>(t));
    for (int k = 0; k < 3; ++k) {
      std::int32_t& node = node_of_[stands[mesh.triangles(t, k)]];
      if (node < 0) {
        node = static_cast<std::int32_t>(vertex_of_.size());
        vertex_of_.push_back(stands[mesh.triangles(t, k)]);
      }
      kept.push_back(node);
    }
  }
  for (Index v = 0; v < count; ++v) node_of_[v] = node_of_[stands[v]];

  corners_ = Eigen::Map<const Triangles>(kept.data(), static_cast<Index>(kept.size()) / 3, 3);
  weights_ = Eigen::Map<const Points>(cotangents.empty() ? nullptr : cotangents[0].data(),
                                      static_cast<Index>(cotangents.size()), 3);
  rest_ = at_nodes(mesh.vertices);
  first_.assign(vertex_of_.size() + 1, 0);
  for (const std::int32_t node : kept) ++first_[node + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  around_.resize(kept.size());
  std::vector<std::int32_t> free(first_.begin(), first_.end() - 1);
  for (std::size_t at = 0; at < kept.size(); ++at) around_[free[kept[at]]++] = static_cast<std::int32_t>(at);
}

Points WeldedSurface::at_nodes(PointsIn moved) const {
  Points result(static_cast<Index>(vertex_of_.size()), 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = moved.row(vertex_of_[i]);
  return result;
}

Points WeldedSurface::normals(const Points& positions) const {
  Points result(triangles(), 3);
  parallel_for(0, triangles(), surface_grain, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) {
      const auto corner = [&](int k) -> Vec3 { return positions.row(corners_(t, k)); };
      result.row(t) = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    }
  });
  return result;
}

std::vector<double> WeldedSurface::rotations(const Points& positions) const {
  const Index count = nodes();
  const auto size = static_cast<std::size_t>(9 * count);
  std::vector<double> spreads(size), result(size);
  parallel_for(0, count, surface_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Mat3 spread = Mat3::Zero();
      around(i, [&](Index t, int k) {
        for (int other = 1; other < 3; ++other) {
          const int l = (k + other) % 3;
          const Index j = corners_(t, l);
          spread += weights_(t, 3 - k - l) * (positions.row(j) - positions.row(i)).transpose() *
                    (rest_.row(j) - rest_.row(i));
        }
      });
      for (int k = 0; k < 3; ++k) {
        Eigen::Map<Vec3> column(&spreads[static_cast<std::size_t>(3 * (k * count + i))]);
        column = spread.col(k);
      }
    }
  });
  closest_rotations<double>(spreads.data(), count, result.data());
  return result;
}

}  // namespace arapfields
