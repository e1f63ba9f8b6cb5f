// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fields/radial_basis.h"

namespace arapfields {

/// The plane on which one coordinate of the cube is 0, and fields of a basis that are symmetric across it,
/// f(S x) = S f(x) with the reflection S. Centers stand in mirrored pairs, whose coefficients are each
/// other's reflections. Reflections change signs alone, so that symmetry is exact.
struct Mirror {
  int axis = 0;              ///< 0, 1 or 2
  std::vector<Index> twins;  ///< (m) the mirrored center of each; one on the plane is its own twin

  /// Points or normals (n,3), reflected.
  Points reflected(PointsIn points) const;
  /// Projects coefficients (basis.size(), 3) onto those of symmetric fields.
  void symmetrise(RowMatrix<double>& coefficients) const;
  /// The basis functions at reflected points, (n, basis.size()), from those at the points: their values, or
  /// their derivatives along the plane.
  RowMatrix<double> reflected_rows(const RowMatrix<double>& rows) const;
  /// Replaces a symmetric matrix over the basis functions, given by its lower triangle, by its mean with the
  /// matrix of the reflected points.
  void symmetrise_matrix(RowMatrix<double>& lower) const;
};

/// Points folded to the side of the plane where the coordinate is positive.
struct FoldedPoints {
  Points points, normals;  ///< (n,3); normals may be empty
  RadialLayout layout;
};
FoldedPoints folded(PointsIn points, PointsIn normals, const RadialLayout& layout, int axis);

/// radial_basis() of folded points, with nearly twice as many centers in mirrored pairs; `mirror` gets their
/// twins. An embedding of the basis must be symmetric (fields/interior_embedding.h).
RadialBasis mirrored_basis(const FoldedPoints& half, const std::vector<RadialScale>& scales, Mirror& mirror);

}  // namespace arapfields
