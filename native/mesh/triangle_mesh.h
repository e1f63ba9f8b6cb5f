// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// A triangle soup: neither closed nor manifold nor free of self-intersections need it be.
struct TriangleMesh {
  Points vertices;      ///< (n,3), any unit
  Triangles triangles;  ///< (m,3), counter-clockwise seen from outside
};

/// Throws InvalidInput naming `vertices` or `triangles` where there are none, where a coordinate is NaN or
/// infinite (says the first such vertex) or where an index is out of range (says the first such triangle).
/// Triangles without area are allowed.
ARAPFIELDS_EXPORT void validate(PointsIn vertices, TrianglesIn triangles);
inline void validate(const TriangleMesh& mesh) { validate(mesh.vertices, mesh.triangles); }

/// The vertices that some triangle refers to, in the order of `vertices`. The mesh must be valid.
ARAPFIELDS_EXPORT Points used_vertices(PointsIn vertices, TrianglesIn triangles);

/// Unit normals (n,3) of the vertices, means of their triangles' weighted by area; zero without a triangle.
/// Vertices in one place have normals of their own.
Points vertex_normals(const TriangleMesh& mesh);

/// Of the bounding box of points (n,3).
inline double diagonal_of(PointsIn points) {
  return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

}  // namespace arapfields
