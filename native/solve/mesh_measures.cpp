// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/mesh_measures.h"

#include <Eigen/Eigenvalues>
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

/// J is looked at near the corners of triangles with an edge that becomes longer or shorter than this, as a
/// factor; at the corners themselves other parts of the surface may touch.
constexpr double changed_edge = 1.5, towards_middle = 0.02;

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

Mat3 jacobian_at(const JetView<double>& jets, Index row) {
  Mat3 result;
  for (int k = 0; k < 3; ++k) result.col(k) = Eigen::Map<const Vec3>(jets.at(first_column(k), row));
  return result;
}

/// Whether the largest singular value is above `most`.
bool stretches_beyond(const Mat3& jacobian, double most) {
  if (!(jacobian.squaredNorm() > most * most)) return false;  // which is at least as large
  Eigen::SelfAdjointEigenSolver<Mat3> squares;
  squares.computeDirect(jacobian.transpose() * jacobian, Eigen::EigenvaluesOnly);
  return squares.eigenvalues()[2] > most * most;
}

/// Collects places beyond limits.
class WrongPlaces {
 public:
  explicit WrongPlaces(const DistortionLimits& limits) : limits_(limits) {}
  void look_at(const Mat3& jacobian, const Vec3& place, const Vec3& normal) {
    const double determinant = jacobian.determinant();
    const bool stretched = stretches_beyond(jacobian, limits_.most_stretch);
    is_wrong_ |= stretched || !(determinant > 0.0);
    if ((stretched || !(determinant >= limits_.least_determinant)) && normal.norm() > 0.0)
      places_.emplace_back(place, normal.normalized());
  }
  /// Evenly chosen ones, where there are more than may be.
  void move_to(MeshMeasures& result) const {
    const Index found = std::ssize(places_), count = std::min(found, MeshMeasures::most_wrong);
    result.is_wrong = is_wrong_;
    result.wrong = {Points(count, 3), Points(count, 3)};
    for (Index i = 0; i < count; ++i) {
      const auto& [place, normal] = places_[static_cast<std::size_t>(i * found / count)];
      result.wrong.points.row(i) = place.transpose();
      result.wrong.normals.row(i) = normal.transpose();
    }
  }

 private:
  DistortionLimits limits_;
  bool is_wrong_ = false;
  std::vector<std::pair<Vec3, Vec3>> places_;
};

}  // namespace

MeshMeasures measure_triangles(const DeformationField& field, const TriangleMesh& mesh,
                               const DistortionLimits& limits) {
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
  double area = 0.0, turned_area = 0.0, largest_turned = 0.0, smallest = 0.0;
  WrongPlaces wrong(limits);
  std::vector<Index> changed;
  Index last_folded = -1;
  const auto fold_at = [&](Index t, double determinant, const Vec3& place) {
    if (result.folded == 0 || determinant < smallest) {
      smallest = determinant;
      result.folded_place = place;
    }
    result.folded += t != last_folded;
    last_folded = t;
  };
  for (Index t = 0; t < count; ++t) {
    bool changes = false;
    Vec3 rest[3], now[3];
    for (int k = 0; k < 3; ++k) {
      rest[k] = corner(looked.vertices, looked.triangles, t, k);
      now[k] = corner(moved, looked.triangles, t, k);
    }
    for (int k = 0; k < 3; ++k) {
      const Vec3 edge = rest[(k + 1) % 3] - rest[k];
      const double ratio = (now[(k + 1) % 3] - now[k]).norm() / edge.norm();
      changes |= ratio > changed_edge || ratio < 1.0 / changed_edge;
      if (std::isfinite(ratio) && ratio > result.longest_edge &&
          (now[(k + 1) % 3] - now[k]).norm() > least_edge * diagonal) {
        result.longest_edge = ratio;
        result.longest_place = rest[k] + 0.5 * edge;
      }
    }
    const Vec3 before = 0.5 * (rest[1] - rest[0]).cross(rest[2] - rest[0]);
    const Vec3 after = 0.5 * (now[1] - now[0]).cross(now[2] - now[0]);
    area += before.norm();
    if (changes) changed.push_back(t);
    const Mat3 jacobian = jacobian_at(jets.view(), t);
    wrong.look_at(jacobian, middles.row(t).transpose(), before);
    const double determinant = jacobian.determinant();
    if (!(determinant > 0.0)) {
      fold_at(t, determinant, middles.row(t).transpose());
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
  if (!changed.empty()) {
    Points corners(3 * std::ssize(changed), 3);
    for (Index i = 0; i < corners.rows(); ++i) {
      const Index t = changed[static_cast<std::size_t>(i / 3)];
      const Vec3 place = corner(looked.vertices, looked.triangles, t, static_cast<int>(i % 3));
      corners.row(i) = (1.0 - towards_middle) * place.transpose() + towards_middle * middles.row(t);
    }
    JetBlock<double> at_corners(corners.rows(), JetOrder::first);
    field.evaluate(field.frame().to_cube(corners), at_corners.view());
    const Distortion there = distortion<double>(JetView<const double>(at_corners.view()));
    result.distortion.min_determinant = std::min(result.distortion.min_determinant, there.min_determinant);
    result.distortion.max_stretch = std::max(result.distortion.max_stretch, there.max_stretch);
    result.distortion.min_stretch = std::min(result.distortion.min_stretch, there.min_stretch);
    for (Index i = 0; i < corners.rows(); ++i) {
      const Index t = changed[static_cast<std::size_t>(i / 3)];
      const Vec3 first = corner(looked.vertices, looked.triangles, t, 0);
      const Mat3 jacobian = jacobian_at(at_corners.view(), i);
      if (jacobian_at(jets.view(), t).determinant() > 0.0 && !(jacobian.determinant() > 0.0))
        fold_at(t, jacobian.determinant(), corners.row(i).transpose());
      wrong.look_at(jacobian, corners.row(i).transpose(),
                    (corner(looked.vertices, looked.triangles, t, 1) - first)
                        .cross(corner(looked.vertices, looked.triangles, t, 2) - first));
    }
  }
  wrong.move_to(result);
  return result;
}

std::vector<std::string> warnings_on(const MeshMeasures& measures) {
  std::vector<std::string> warnings;
  if (measures.folded > 0)
    warnings.push_back("the field folds at " + std::to_string(measures.folded) + " of " +
                       std::to_string(measures.measured) + " triangles, the worst at " +
                       place_text(measures.folded_place));
  if (measures.has_long_triangles())
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
