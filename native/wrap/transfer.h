// SPDX-License-Identifier: GPL-3.0-or-later
// What one mesh has, carried over to another that it was wrapped onto.
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "fields/field.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Where points (n) lie on a mesh.
struct SurfacePlaces {
  std::vector<std::int32_t> triangles;  ///< (n)
  Points shares;                        ///< (n,3) of the triangle's corners: ≥ 0, of sum one
  Vector distances;                     ///< (n) from the points, in mesh units
};

/// The nearest place of a mesh for each point (n,3), on a side that faces as the point's normal (n,3) does
/// where there is one nearby: thin parts have two sides. A normal of length 0 takes either side.
SurfacePlaces places_on(const TriangleMesh& mesh, PointsIn points, PointsIn normals,
                        const Progress& progress = {});

/// A source mesh wrapped onto a target, by a field or by another tool: its moved vertices and how the surface
/// turns and stretches about each.
struct ARAPFIELDS_EXPORT WrappedMesh {
  /// Throws InvalidInput as validate() does.
  WrappedMesh(const TriangleMesh& source, const DeformationField& field);
  /// The Jacobians are those of the triangles; across the surface the scale is the square root of the area's.
  /// Source: Sumner and Popović 2004, "Deformation Transfer for Triangle Meshes", section 3.
  WrappedMesh(const TriangleMesh& source, PointsIn moved);

  TriangleMesh moved;
  std::vector<Mat3> jacobians;  ///< of each vertex
};

/// Carries what the vertices of the source have to those of the target, or back. Built once for any number of
/// values and displacements.
class ARAPFIELDS_EXPORT Correspondence {
 public:
  enum class Direction { to_target, to_source };
  /// Throws InvalidInput as validate() does; Cancelled.
  Correspondence(const WrappedMesh& source, const TriangleMesh& target, Direction direction,
                 const Progress& progress = {});

  /// Where each receiving vertex lies on the giving mesh.
  const SurfacePlaces& places() const { return places_; }
  Index giving() const { return giving_; }
  /// Values (n,k) of the giving vertices, interpolated linearly: (m,k) of the receiving ones.
  RowMatrix<double> values(const RowMatrix<double>& given) const;
  /// Displacements (n,3), as of a shape key, turned and scaled by the wrap: J(x) δ(x), or J(x)⁻¹ δ back.
  Points displacements(PointsIn given) const;

 private:
  Direction direction_;
  Index giving_;
  Triangles triangles_;          // of the giving mesh
  std::vector<Mat3> jacobians_;  // of the source's vertices, in the direction of the transfer
  SurfacePlaces places_;
};

}  // namespace arapfields
