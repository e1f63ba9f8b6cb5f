// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/welded_surface.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/parallel.h"
#include "distance/morton.h"
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
constexpr Index surface_grain = 4096, rotations_at_once = 512, check_every = 16384;

}  // namespace

WeldedSurface::WeldedSurface(const TriangleMesh& mesh, PointsIn moved, const Progress& progress) {
  const Index count = mesh.vertices.rows();
  const std::vector<std::int32_t> first = first_at_position(mesh.vertices);
  const double near = together * diagonal_of(moved);

  // The vertex that stands for each: the first at its place that has moved to the same one.
  std::vector<std::int32_t> stands(count), next(count, -1);
  for (Index v = 0; v < count; ++v) {
    if (v % check_every == 0) progress.check();
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
  Points places(mesh.triangles.rows(), 3);
  for (Index t = 0; t < places.rows(); ++t) places.row(t) = mesh.vertices.row(mesh.triangles(t, 0));
  Index visited = 0;
  for (const std::uint32_t t : morton_order(places)) {
    if (visited++ % check_every == 0) progress.check();
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

  progress.check();
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

  // Each node's list has room for two of each triangle's corners at first.
  std::vector<std::int32_t> lists(2 * around_.size());
  first_neighbour_.assign(vertex_of_.size() + 1, 0);
  parallel_for(0, nodes(), surface_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto list = lists.begin() + 2 * first_[i];
      auto last = list;
      around(i, [&](Index t, int k) {
        for (int other = 1; other < 3; ++other) *last++ = corners_(t, (k + other) % 3);
      });
      std::sort(list, last);
      first_neighbour_[i + 1] = static_cast<std::int32_t>(std::unique(list, last) - list);
    }
  });
  for (std::size_t i = 1; i < first_neighbour_.size(); ++i) first_neighbour_[i] += first_neighbour_[i - 1];
  neighbours_.resize(first_neighbour_.back());
  for (Index i = 0; i < nodes(); ++i)
    std::copy_n(lists.begin() + 2 * first_[i], first_neighbour_[i + 1] - first_neighbour_[i],
                neighbours_.begin() + first_neighbour_[i]);
  const std::vector<double> edge_weights = this->edge_weights(Vector::Ones(triangles()));
  edges_.resize(neighbours_.size());
  parallel_for(0, nodes(), surface_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for (std::int32_t at = first_neighbour_[i]; at < first_neighbour_[i + 1]; ++at)
        edges_[at] = {edge_weights[at] * (rest_.row(i) - rest_.row(neighbours_[at])).transpose(),
                      edge_weights[at]};
  });
}

Points WeldedSurface::at_nodes(PointsIn moved) const {
  Points result(static_cast<Index>(vertex_of_.size()), 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = moved.row(vertex_of_[i]);
  return result;
}

void WeldedSurface::normals(const Points& positions, Points& result) const {
  result.resize(triangles(), 3);
  parallel_for(0, triangles(), surface_grain, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) result.row(t) = normal(t, positions);
  });
}

std::vector<double> WeldedSurface::edge_weights(const Vector& factors) const {
  std::vector<double> result(neighbours_.size());
  parallel_for(0, nodes(), surface_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      around(i, [&](Index t, int k) {
        for (int other = 1; other < 3; ++other) {
          const int l = (k + other) % 3;
          std::int32_t at = first_neighbour_[i];
          while (neighbours_[at] != corners_(t, l)) ++at;
          result[at] += factors[t] * weights_(t, 3 - k - l);
        }
      });
  });
  return result;
}

Mat3 WeldedSurface::spread(Index node, const Points& positions) const {
  Mat3 result = Mat3::Zero();
  edges(node, [&](Index j, const Edge& edge) {
    result += (positions.row(node) - positions.row(j)).transpose() * edge.rest.transpose();
  });
  return result;
}

Mat3 WeldedSurface::rotation(Index node, const Points& positions) const {
  return closest_rotation(spread(node, positions));
}

void WeldedSurface::rotations(const Points& positions, std::vector<Mat3>& result) const {
  result.resize(static_cast<std::size_t>(nodes()));
  parallel_for(0, nodes(), rotations_at_once, [&](Index begin, Index end) {
    const Index count = end - begin;
    std::vector<double> spreads(static_cast<std::size_t>(9 * count)), turns(spreads.size());
    const auto column = [&](std::vector<double>& blocks, Index i, int k) {
      return Eigen::Map<Vec3>(&blocks[static_cast<std::size_t>(3 * (k * count + i - begin))]);
    };
    for (Index i = begin; i < end; ++i) {
      const Mat3 of_node = spread(i, positions);
      for (int k = 0; k < 3; ++k) column(spreads, i, k) = of_node.col(k);
    }
    closest_rotations<double>(spreads.data(), count, turns.data());
    for (Index i = begin; i < end; ++i)
      for (int k = 0; k < 3; ++k) result[i].col(k) = column(turns, i, k);
  });
}

}  // namespace arapfields
