// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/frame.h"
#include "core/task.h"
#include "core/types.h"
#include "distance/signed_distance.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Tells which points of a mesh see each other through the inside of the shape: the straight segment between
/// them, a little below the surface at both ends, meets no triangle of their own piece (mesh/pieces.h).
/// Points near each other on one thin and curved sheet, whose segment leaves the shape, see each other by way
/// of places of the sheet between them. Two faces of a piece in one place hide each other; points of
/// different pieces do not.
class ARAPFIELDS_EXPORT_TO_TESTS InsideSight {
 public:
  /// A valid mesh in mesh coordinates whose triangles face outwards, and the frame of the cube in which all
  /// points are. Throws Cancelled.
  InsideSight(const TriangleMesh& mesh, const Frame& frame, const Progress& progress = {});

  /// Points just below the surface.
  struct Eyes {
    Points places;                     ///< (n,3)
    Points normals;                    ///< (n,3) of the surface above them
    Vector depths;                     ///< (n) below it, where the shape is thick enough
    std::vector<std::int32_t> pieces;  ///< (n) the connected piece of the mesh that each lies on
  };
  /// Points (n,3) of the surface with outward unit normals (n,3), moved inwards by `depths` (n), or by half
  /// of the thickness of the shape where it is thinner than twice that.
  Eyes below(PointsIn points, PointsIn normals, const Vector& depths) const;
  /// For each pair of rows whether the first of `from` and the second of `to` see each other.
  std::vector<bool> see(const Eyes& from, const Eyes& to,
                        const std::vector<std::pair<Index, Index>>& pairs) const;

 private:
  using Pairs = std::vector<std::pair<Index, Index>>;
  std::vector<bool> see_straight(const Eyes& from, const Eyes& to, const Pairs& pairs) const;
  std::vector<bool> see(const Eyes& from, const Eyes& to, const Pairs& pairs, int bends) const;

  SignedDistance distance_;
  Points triangle_normals_;
  std::vector<std::int32_t> piece_of_triangle_;
  std::shared_ptr<const SignedDistance> inner_triangles_;  // null: there is one piece
  double size_ = 1.0;                                      // of the mesh in the cube
};

}  // namespace arapfields
