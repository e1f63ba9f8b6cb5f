// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/frame.h"
#include "core/implicit.h"
#include "core/task.h"
#include "distance/signed_distance.h"
#include "fields/inverse.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// A rest surface {Φ = 0}, its deformation f, and a mesh of the deformed surface.
struct DeformedShape {
  const ImplicitFunction& rest;
  const DeformationField& field;
  const DeformationField* inverse = nullptr;  ///< a trained one, in its own frame; null: Newton's method
  const TriangleMesh& mesh;                   ///< of the rest surface, mesh coordinates
  const Points& moved;                        ///< f of its vertices
  double band = 0.0;                          ///< a length in mesh coordinates
};

/// Φ∘f⁻¹ in the cube of `frame`, as lengths in that cube. Away from a surface a field need not be invertible,
/// nor a trained inverse be one, and nothing but the sign matters: from `band` to twice that distance from
/// the moved mesh the function passes smoothly into the signed distance to that mesh, which also stands in
/// where no inverse is found beside the surface, and inside of another part that the surface has run into.
class DeformedFunction final : public ImplicitFunction {
 public:
  DeformedFunction(const DeformedShape& shape, const Frame& frame, const Progress& progress);

  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override;
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override;
  Frame frame() const override { return frame_; }
  bool continuous() const override { return shape_.rest.continuous(); }

  Index inverted() const { return inverted_; }
  Index failures() const { return failures_; }

 private:
  /// Rest positions of points (mesh coordinates on both sides); NaN where none is found.
  Points by_newton(PointsIn moved) const;
  Points by_network(PointsIn moved) const;
  /// Whether each point (mesh coordinates), just outside of the sheet nearest to it, is inside another one.
  std::vector<bool> covered(PointsIn points) const;

  DeformedShape shape_;
  Frame frame_;
  Progress check_;
  SignedDistance distance_;
  NewtonInverse newton_;
  mutable Index inverted_ = 0, failures_ = 0;
};

}  // namespace arapfields
