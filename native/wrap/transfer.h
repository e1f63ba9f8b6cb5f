// SPDX-License-Identifier: GPL-3.0-or-later
// What one mesh has, carried over to another that it was wrapped onto.
#pragma once

#include <memory>
#include <vector>

#include "fields/field.h"
#include "wrap/surface_places.h"

namespace arapfields {

class CarriedMotion;

/// A source mesh wrapped onto a target, by a field or by another tool: its moved vertices and how the surface
/// turns and stretches about each.
struct ARAPFIELDS_EXPORT WrappedMesh {
  /// Throws InvalidInput as validate() does.
  WrappedMesh(const TriangleMesh& source, const DeformationField& field);
  /// The Jacobians are those of the triangles; across the surface the scale is the square root of the area's.
  /// Source: Sumner and Popović 2004, "Deformation Transfer for Triangle Meshes", section 3.
  WrappedMesh(const TriangleMesh& source, PointsIn moved);

  TriangleMesh rest;
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
  Index giving() const { return giving_.vertices.rows(); }
  /// Values (n,k) of the giving vertices, interpolated linearly: (m,k) of the receiving ones.
  RowMatrix<double> values(const RowMatrix<double>& given) const;
  /// Displacements (n,3), as of a shape key, carried as SmoothMap and CarriedMotion say. The first call
  /// prepares the others; any thread may call. Throws Cancelled.
  Points displacements(PointsIn given, const Progress& progress = {}) const;

 private:
  struct Motion;

  TriangleMesh giving_;  // each in its own space
  TriangleMesh receiving_;
  SurfacePlaces places_;
  std::shared_ptr<Motion> motion_;
};

}  // namespace arapfields
