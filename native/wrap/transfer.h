// SPDX-License-Identifier: GPL-3.0-or-later
// Transfer of vertex data between a mesh and the one that it was wrapped onto.
#pragma once

#include <memory>
#include <vector>

#include "fields/field.h"
#include "wrap/carried_motion.h"

namespace arapfields {

class CarriedMotion;

/// A source mesh wrapped onto a target, by a field or by another tool: its moved vertices, and the motion's
/// Jacobian at each.
struct ARAPFIELDS_EXPORT WrappedMesh {
  /// Throws InvalidInput as validate() does.
  WrappedMesh(const TriangleMesh& source, const DeformationField& field);
  /// Jacobians are of the triangles; their scale along the normal is the square root of the area ratio.
  /// Source: Sumner and Popović 2004, "Deformation Transfer for Triangle Meshes", section 3.
  WrappedMesh(const TriangleMesh& source, PointsIn moved);

  TriangleMesh rest;
  TriangleMesh moved;
  std::vector<Mat3> jacobians;  ///< of each vertex
};

/// Transfers vertex data from the source to the target, or back. Built once for any number of values and
/// displacements.
class ARAPFIELDS_EXPORT Correspondence {
 public:
  enum class Direction { to_target, to_source };
  /// Throws InvalidInput as validate() does; Cancelled.
  Correspondence(const WrappedMesh& source, const TriangleMesh& target, Direction direction,
                 const Progress& progress = {});

  /// The point of each receiving vertex on the giving mesh.
  const SurfacePlaces& places() const { return places_; }
  Index giving() const { return giving_.vertices.rows(); }
  /// Values (n,k) of the giving vertices, interpolated linearly: (m,k) of the receiving ones.
  RowMatrix<double> values(const RowMatrix<double>& given) const;
  /// Displacements (n,3), as of a shape key, transferred by DisplacementMap and CarriedMotion. The first call
  /// factors the system for all others; any thread may call. Throws Cancelled.
  Points displacements(PointsIn given, const Progress& progress = {}) const;

 private:
  struct Motion;

  TriangleMesh giving_;  // each in its own space
  TriangleMesh receiving_;
  SurfacePlaces places_;
  std::shared_ptr<Motion> motion_;
};

}  // namespace arapfields
