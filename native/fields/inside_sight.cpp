// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/inside_sight.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "mesh/pieces.h"

namespace arapfields {
namespace {

/// Depth, in sizes of the mesh, at which a ray into the shape begins, so that it does not meet the face that
/// it comes from, nor another one in the same place.
constexpr double below_own_face = 1e-7;

/// Depth, in sizes of the mesh, at which the piece of a point is looked for, where pieces may touch.
constexpr double inside_own_piece = 1e-6;

/// Points on one sheet see each other around its bends if they are nearer than so many of their depths, their
/// normals are alike or opposite (least cosine), and the ways to the place between them are free, halved so
/// often.
constexpr double near_depths = 20.0, one_sheet_cosine = 0.3;
constexpr int most_bends = 2;

}  // namespace

InsideSight::InsideSight(const TriangleMesh& mesh, const Frame& frame, const Progress& progress)
    : distance_(frame.to_cube(mesh.vertices), mesh.triangles, progress),
      piece_of_triangle_(pieces_of(mesh)),
      size_(diagonal_of(mesh.vertices) / frame.scale) {
  triangle_normals_.resize(mesh.triangles.rows(), 3);
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices.row(mesh.triangles(t, k))); };
    triangle_normals_.row(t) =
        (corner(1) - corner(0)).cross(corner(2) - corner(0)).stableNormalized().transpose();
  }
  if (std::all_of(piece_of_triangle_.begin(), piece_of_triangle_.end(),
                  [&](std::int32_t piece) { return piece == piece_of_triangle_.front(); }))
    return;
  // Each triangle a little inside its own piece.
  const Points cube = frame.to_cube(mesh.vertices);
  Points corners(mesh.triangles.size(), 3);
  Triangles rows(mesh.triangles.rows(), 3);
  for (Index t = 0; t < rows.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      rows(t, k) = static_cast<std::int32_t>(3 * t + k);
      corners.row(rows(t, k)) =
          cube.row(mesh.triangles(t, k)) - inside_own_piece * size_ * triangle_normals_.row(t);
    }
  inner_triangles_ = std::make_shared<const SignedDistance>(std::move(corners), std::move(rows), progress);
}

InsideSight::Eyes InsideSight::below(PointsIn points, PointsIn normals, const Vector& depths) const {
  Eyes result{points, normals, depths, {}};
  if (inner_triangles_ == nullptr)
    result.pieces.assign(static_cast<std::size_t>(points.rows()), piece_of_triangle_.front());
  else
    for (const std::int32_t triangle :
         inner_triangles_->closest(points - 2.0 * inside_own_piece * size_ * normals).triangles)
      result.pieces.push_back(piece_of_triangle_[static_cast<std::size_t>(triangle)]);
  const double start = below_own_face * size_;
  const Points from = points - start * normals;
  const Points to = points - 2.0 * (depths.asDiagonal() * normals);
  const Vector hits = distance_.first_crossings(from, to, piece_of_triangle_, result.pieces);
  for (Index i = 0; i < points.rows(); ++i) {
    const double free = start + std::min(hits[i], 1.0) * (2.0 * depths[i] - start);
    result.places.row(i) -= 0.5 * free * normals.row(i);
  }
  return result;
}

std::vector<bool> InsideSight::see(const Eyes& from, const Eyes& to, const Pairs& pairs) const {
  return see(from, to, pairs, most_bends);
}

std::vector<bool> InsideSight::see(const Eyes& from, const Eyes& to, const Pairs& pairs, int bends) const {
  std::vector<bool> result = see_straight(from, to, pairs);
  std::vector<std::size_t> bent;
  for (std::size_t k = 0; k < pairs.size() && bends > 0; ++k) {
    const auto& [i, j] = pairs[k];
    const double near = near_depths * std::max(from.depths[i], to.depths[j]);
    if (!result[k] && std::abs(from.normals.row(i).dot(to.normals.row(j))) > one_sheet_cosine &&
        (from.places.row(i) - to.places.row(j)).squaredNorm() < near * near)
      bent.push_back(k);
  }
  if (bent.empty()) return result;
  const auto count = static_cast<Index>(bent.size());
  Points middle(count, 3), normals(count, 3);
  Vector depths(count);
  for (Index k = 0; k < count; ++k) {
    const auto& [i, j] = pairs[bent[static_cast<std::size_t>(k)]];
    middle.row(k) = 0.5 * (from.places.row(i) + to.places.row(j));
    depths[k] = from.depths[i];
  }
  const ClosestPoints closest = distance_.closest(middle);
  for (Index k = 0; k < count; ++k)
    normals.row(k) = triangle_normals_.row(closest.triangles[static_cast<std::size_t>(k)]);
  const Eyes between = below(closest.points, normals, depths);
  Pairs first, second;
  for (Index k = 0; k < count; ++k) {
    const auto& [i, j] = pairs[bent[static_cast<std::size_t>(k)]];
    first.emplace_back(i, k);
    second.emplace_back(k, j);
  }
  const std::vector<bool> before = see(from, between, first, bends - 1),
                          after = see(between, to, second, bends - 1);
  for (std::size_t k = 0; k < bent.size(); ++k) result[bent[k]] = before[k] && after[k];
  return result;
}

std::vector<bool> InsideSight::see_straight(const Eyes& from, const Eyes& to, const Pairs& pairs) const {
  const auto count = static_cast<Index>(pairs.size());
  Points begin(count, 3), end(count, 3);
  std::vector<std::int32_t> pieces(pairs.size());
  for (Index k = 0; k < count; ++k) {
    const auto& [i, j] = pairs[static_cast<std::size_t>(k)];
    begin.row(k) = from.places.row(i);
    end.row(k) = to.places.row(j);
    pieces[static_cast<std::size_t>(k)] = from.pieces[static_cast<std::size_t>(i)];
  }
  const Vector hits = distance_.first_crossings(begin, end, piece_of_triangle_, pieces);
  std::vector<bool> result(pairs.size());
  for (Index k = 0; k < count; ++k) {
    const auto& [i, j] = pairs[static_cast<std::size_t>(k)];
    // Points of different pieces overlap or touch as they may; only a piece hides its own parts.
    const bool same = from.pieces[static_cast<std::size_t>(i)] == to.pieces[static_cast<std::size_t>(j)];
    result[static_cast<std::size_t>(k)] = !same || std::isinf(hits[k]);
  }
  return result;
}

}  // namespace arapfields
