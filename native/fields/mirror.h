// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fields/radial_basis.h"

namespace arapfields {

/// The plane on which one coordinate of the cube is 0, and fields of a basis that are symmetric across it,
/// f(S x) = S f(x), S the reflection: centers stand in mirrored pairs, whose coefficients are each other's
/// reflections. Reflections change signs alone, so that this holds without rounding.
struct Mirror {
  int axis = 0;              ///< 0, 1 or 2
  std::vector<Index> twins;  ///< (m) the center mirrored to each; a center on the plane is its own

  /// Points or normals (n,3), reflected.
  Points reflected(PointsIn points) const;
  /// The symmetric part of coefficients (basis.size(), 3): the nearest that are symmetric.
  void symmetrise(RowMatrix<double>& coefficients) const;
  /// Of rows (n, basis.size()), values or derivatives along the plane of the basis functions at points: the
  /// same at the reflected points.
  RowMatrix<double> reflected_rows(const RowMatrix<double>& rows) const;
  /// Of a matrix over the basis functions of which the lower triangle is filled: the mean with that of the
  /// reflected points.
  void symmetrise_matrix(RowMatrix<double>& lower) const;
};

/// What lies across the plane folded to the side where the coordinate is positive.
struct FoldedPoints {
  Points points, normals;  ///< (n,3); normals may be empty
  RadialLayout layout;
};
FoldedPoints folded(PointsIn points, PointsIn normals, const RadialLayout& layout, int axis);

/// As radial_basis(), of folded points, with nearly twice as many centers, in mirrored pairs: `mirror` gets
/// their twins. Its own embedding must be symmetric (fields/interior_embedding.h).
RadialBasis mirrored_basis(const FoldedPoints& half, const std::vector<RadialScale>& scales, Mirror& mirror);

}  // namespace arapfields
