// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "core/frame.h"
#include "core/implicit.h"
#include "neural/mlp_shape.h"

namespace arapfields {

class Mlp;

/// A network with one output as a signed distance function on the unit cube (cube units, negative inside),
/// with the frame that places the cube in mesh coordinates.
class ARAPFIELDS_EXPORT NeuralSdf final : public ImplicitFunction {
 public:
  /// Throws InvalidInput for a network that has not one output.
  explicit NeuralSdf(Mlp mlp, const Frame& frame = {});
  ~NeuralSdf() override;
  /// A published network: its frame is the identity. Throws InvalidInput as shape_of() does.
  static std::shared_ptr<NeuralSdf> from_layers(const Layers& layers, int octaves, double frequency,
                                                double sharpness, const Frame& frame = {});

  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override;
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override;

  /// Distances (p) at points (p,3), all in mesh units. Outside the cube, where the network has learnt
  /// nothing: its value at the nearest point of the cube plus the distance to that point.
  Vector distances(PointsIn points) const;
  /// ∂distance/∂point (p,3) of the same.
  Points gradients(PointsIn points) const;

  Frame frame() const override { return frame_; }
  const MlpShape& shape() const;
  /// What from_layers() takes.
  Layers layers() const;
  /// The network itself, for sources that know its class.
  const Mlp& mlp() const { return *mlp_; }

 private:
  std::unique_ptr<Mlp> mlp_;
  Frame frame_;
};

}  // namespace arapfields
