// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/mesh_measures.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <utility>

namespace arapfields {
namespace {

/// An edge that becomes longer than so many times itself is told of.
constexpr double long_edge = 3.0;
/// Edges that stay shorter than this, in diagonals of the mesh, are not seen.
constexpr double least_edge = 1e-3;
/// Share of the measured triangles up to which folded or turned ones are not told of: slivers turn at a
/// touch.
constexpr double few_turned = 0.002;

Vec3 corner(const Points& vertices, const Triangles& triangles, Index t, int k) {
  return vertices.row(triangles(t, k % 3)).transpose();
}

/// Rows of the triangles with the longest edges, in their order.
std::vector<Index> largest(const TriangleMesh& mesh, Index most) {
  std::vector<Index> rows(static_cast<std::size_t>(mesh.triangles.rows()));
  std::iota(rows.begin(), rows.end(), Index{0});
  if (std::ssize(rows) <= most) return rows;
  std::vector<double> lengths;
  for (const Index t : rows) {
    double length = 0.0;
    for (int k = 0; k < 3; ++k)
      length = std::max(length, (corner(mesh.vertices, mesh.triangles, t, k) -
                                 corner(mesh.vertices, mesh.triangles, t, k + 1))
                                    .squaredNorm());
    lengths.push_back(length);
  }
  std::nth_element(rows.begin(), rows.begin() + most, rows.end(), [&](Index a, Index b) {
    return lengths[a] != lengths[b] ? lengths[a] > lengths[b] : a < b;
  });
  rows.resize(static_cast<std::size_t>(most));
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// The triangles of some rows, with the vertices that they use.
TriangleMesh part_of(const TriangleMesh& mesh, const std::vector<Index>& rows) {
  std::vector<std::int32_t> number(static_cast<std::size_t>(mesh.vertices.rows()), -1);
  std::vector<Index> used;
  Triangles triangles(std::ssize(rows), 3);
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      std::int32_t& own = number[mesh.triangles(rows[i], k)];
      if (own < 0) {
        own = static_cast<std::int32_t>(used.size());
        used.push_back(mesh.triangles(rows[i], k));
      }
      triangles(static_cast<Index>(i), k) = own;
    }
  return {mesh.vertices(used, Eigen::all), std::move(triangles)};
}

std::string place_text(const Vec3& place) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.4g, %.4g, %.4g)", place[0], place[1], place[2]);
  return text;
}

std::string number_of(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace

MeshMeasures measure_triangles(const DeformationField& field, const TriangleMesh& mesh) {
  MeshMeasures result;
  const std::vector<Index> rows = largest(mesh, MeshMeasures::most_measured);
  const bool whole = std::ssize(rows) == mesh.triangles.rows();
  const TriangleMesh part = whole ? TriangleMesh() : part_of(mesh, rows);
  const TriangleMesh& looked = whole ? mesh : part;
  const Points moved = field.at_vertices(looked);
  const Index count = looked.triangles.rows();
  Points middles(count, 3);
  for (Index t = 0; t < count; ++t)
    middles.row(t) =
        (corner(looked.vertices, looked.triangles, t, 0) + corner(looked.vertices, looked.triangles, t, 1) +
         corner(looked.vertices, looked.triangles, t, 2))
            .transpose() /
        3.0;
  JetBlock<double> jets(count, JetOrder::first);
  field.evaluate(field.frame().to_cube(middles), jets.view());
  result.measured = count;
  result.distortion = distortion<double>(JetView<const double>(jets.view()));
  const double diagonal = diagonal_of(mesh.vertices);
  double area = 0.0, turned_area = 0.0, largest_turned = 0.0;
  for (Index t = 0; t < count; ++t) {
    Vec3 rest[3], now[3];
    for (int k = 0; k < 3; ++k) {
      rest[k] = corner(looked.vertices, looked.triangles, t, k);
      now[k] = corner(moved, looked.triangles, t, k);
    }
    for (int k = 0; k < 3; ++k) {
      const Vec3 edge = rest[(k + 1) % 3] - rest[k];
      const double ratio = (now[(k + 1) % 3] - now[k]).norm() / edge.norm();
      if (std::isfinite(ratio) && ratio > result.longest_edge &&
          (now[(k + 1) % 3] - now[k]).norm() > least_edge * diagonal) {
        result.longest_edge = ratio;
        result.longest_place = rest[k] + 0.5 * edge;
      }
    }
    const Vec3 before = 0.5 * (rest[1] - rest[0]).cross(rest[2] - rest[0]);
    const Vec3 after = 0.5 * (now[1] - now[0]).cross(now[2] - now[0]);
    area += before.norm();
    Mat3 jacobian;
    for (int k = 0; k < 3; ++k) jacobian.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), t));
    const double determinant = jacobian.determinant();
    if (!(determinant > 0.0)) {
      ++result.folded;
      continue;
    }
    // Normals move by the cofactors of J.
    if (!((determinant * jacobian.inverse().transpose() * before).dot(after) < 0.0)) continue;
    ++result.turned;
    turned_area += before.norm();
    if (before.norm() > largest_turned) {
      largest_turned = before.norm();
      result.turned_place = middles.row(t).transpose();
    }
  }
  if (area > 0.0) result.turned_share = turned_area / area;
  return result;
}

std::vector<std::string> warnings_on(const MeshMeasures& measures) {
  std::vector<std::string> warnings;
  if (static_cast<double>(measures.folded) > few_turned * static_cast<double>(measures.measured))
    warnings.push_back("the field folds at the middles of " + std::to_string(measures.folded) + " of " +
                       std::to_string(measures.measured) + " triangles");
  if (static_cast<double>(measures.turned) > few_turned * static_cast<double>(measures.measured))
    warnings.push_back(std::to_string(measures.turned) + " of " + std::to_string(measures.measured) +
                       " triangles turn over (" + number_of("%.2g", 100.0 * measures.turned_share) +
                       " % of the area), the largest at " + place_text(measures.turned_place) +
                       ": they are too long for this motion; subdivide them, or remesh the result");
  if (measures.longest_edge > long_edge)
    warnings.push_back("an edge becomes " + number_of("%.3g", measures.longest_edge) + " times as long, at " +
                       place_text(measures.longest_place));
  return warnings;
}

}  // namespace arapfields
