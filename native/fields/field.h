// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/frame.h"
#include "core/jets.h"
#include "core/types.h"
#include "mesh/triangle_mesh.h"
#include "optimize/optimizer.h"

namespace arapfields {

class Tensor;

/// A deformation f: R³ → R³ in the coordinates of the unit cube, with its jets: the interface for energies,
/// extraction and results. The frame maps the cube to mesh coordinates.
class ARAPFIELDS_EXPORT DeformationField {
 public:
  virtual ~DeformationField() = default;
  /// Jets at points (n,3), all in cube coordinates; `out` has count n and any order. Batched and parallel.
  virtual void evaluate(PointsIn points, JetView<double> out) const = 0;
  /// Jets (columns, n, 3) at points (n,3), in their dtype and on their device: computed there by fields on
  /// the same device, else by evaluate().
  virtual Tensor jets(const Tensor& points, JetOrder order) const;

  /// Deformed positions of points (n,3), all in mesh coordinates.
  virtual Points at(PointsIn mesh_points) const {
    Points values(mesh_points.rows(), 3);
    evaluate(frame_.to_cube(mesh_points), {values.data(), values.rows(), JetOrder::value});
    return frame_.to_mesh(values);
  }

  /// Deformed vertices (n,3) of a valid mesh, all in mesh coordinates. Where parts of the mesh touch at rest,
  /// a field on the surface takes each vertex on the side that its triangles show.
  virtual Points at_vertices(const TriangleMesh& mesh) const { return at(mesh.vertices); }

  /// Whether f⁻¹ has a closed form, preimages().
  virtual bool has_preimages() const { return false; }
  /// f⁻¹ at points (n,3), all in cube coordinates; only if has_preimages().
  virtual Points preimages(PointsIn points) const { return Points(points.rows(), 3); }

  const Frame& frame() const { return frame_; }
  void set_frame(const Frame& frame) { frame_ = frame; }
  /// Points (n,3) of the rest surface in cube coordinates: starting points of NewtonInverse; may be empty.
  const Points& rest_points() const { return rest_points_; }
  void set_rest_points(Points points) { rest_points_ = std::move(points); }

 private:
  Frame frame_;
  Points rest_points_;
};

/// A field whose parameters a first-order method can train, with the pull-back from cotangents of its jets to
/// the parameters' gradient. Tensors are on the field's device and have its dtype.
class ARAPFIELDS_EXPORT TrainableField : public DeformationField {
 public:
  /// Jets (columns, n, 3) at points (n,3); stores the activations for pull_back() until the next call.
  virtual Tensor forward(const Tensor& points, JetOrder order) = 0;
  /// The same at points in main memory; never waits for the field's device.
  virtual Tensor forward_at(PointsIn points, JetOrder order) = 0;
  /// Adds Jᵀ·cotangents (columns, n, 3) of the last forward call to gradient().
  virtual void pull_back(const Tensor& cotangents) = 0;
  /// All parameters, and their gradient, as one contiguous vector (p).
  virtual Tensor& parameters() = 0;
  virtual Tensor& gradient() = 0;
  /// The places of matrices among the parameters, for optimizers of matrices (optimize/optimizer.h).
  virtual std::vector<MatrixPlace> matrices() const { return {}; }
  /// Adds an offset (cube coordinates) to f.
  virtual void translate(const Vec3& offset) = 0;
};

}  // namespace arapfields
