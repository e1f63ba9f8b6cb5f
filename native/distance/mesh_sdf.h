// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/implicit.h"
#include "distance/signed_distance.h"

namespace arapfields {

/// The exact signed distance of a triangle soup as an implicit function, in the cube of mesh_frame(): sampled
/// and extracted like a fit, without one. Negative where the winding number exceeds 1/2.
class ARAPFIELDS_EXPORT MeshSdf final : public ImplicitFunction {
 public:
  /// Throws InvalidInput as mesh_frame() and SignedDistance do. `progress` only cancels.
  MeshSdf(PointsIn vertices, TrianglesIn triangles, const Progress& progress = {});

  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override;
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override;
  Frame frame() const override { return frame_; }
  std::optional<double> gradient_bound() const override { return 1.0; }
  /// Closed soups alone: an open one's winding number passes 1/2 also across its holes, where the distance
  /// jumps from one sign to the other.
  bool continuous() const override { return distance_.is_closed(); }

  /// The soup itself.
  const Points& vertices() const { return vertices_; }
  const Triangles& triangles() const { return triangles_; }
  /// Distances (p) at points (p,3), all in mesh units, anywhere in space.
  Vector distances(PointsIn points, const Progress& progress = {}) const;
  /// ∂distance/∂point (p,3) of the same: unit length, pointing outwards; on a triangle its normal.
  Points gradients(PointsIn points, const Progress& progress = {}) const;

 private:
  Vector evaluate(PointsIn points, Points* gradients, const Progress& progress) const;

  Frame frame_;
  Points vertices_;
  Triangles triangles_;
  SignedDistance distance_;
  Points normals_;  // of the triangles, unit length; 0 of degenerate ones
};

}  // namespace arapfields
