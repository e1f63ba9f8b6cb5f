// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/inside_sight.h"

#include <algorithm>
#include <cmath>

#include "distance/welded_vertices.h"

namespace arapfields {
namespace {

/// Depth, in sizes of the mesh, at which a ray into the shape begins, so that it does not meet the face that
/// it comes from, nor another one in the same place.
constexpr double below_own_face = 1e-7;

}  // namespace

InsideSight::InsideSight(const TriangleMesh& mesh, const Frame& frame, const Progress& progress)
    : distance_(frame.to_cube(mesh.vertices), mesh.triangles, progress),
      size_(diagonal_of(mesh.vertices) / frame.scale) {
  const std::vector<Index> pieces = WeldedVertices(mesh).pieces(mesh);
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    piece_of_triangle_.push_back(static_cast<std::int32_t>(pieces[mesh.triangles(t, 0)]));
  is_one_piece_ = std::all_of(piece_of_triangle_.begin(), piece_of_triangle_.end(),
                              [&](std::int32_t piece) { return piece == piece_of_triangle_.front(); });
}

InsideSight::Eyes InsideSight::below(PointsIn points, PointsIn normals, const Vector& depths) const {
  Eyes result{points, {}};
  if (is_one_piece_)
    result.pieces.assign(static_cast<std::size_t>(points.rows()), piece_of_triangle_.front());
  else
    for (const std::int32_t triangle : distance_.closest(points).triangles)
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

std::vector<bool> InsideSight::see(const Eyes& from, const Eyes& to,
                                   const std::vector<std::pair<Index, Index>>& pairs) const {
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
