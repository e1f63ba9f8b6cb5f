// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <utility>

#include "core/implicit.h"

namespace arapfields {

/// An implicit function made of a batched call, such as a signed distance at the inverse images of a
/// deformation. Gradients are central differences. With values in single precision their error is about 1e-3:
/// small enough for the bound on |∇Φ| by which extraction leaves out empty space.
class ARAPFIELDS_EXPORT BatchFunction final : public ImplicitFunction {
 public:
  /// Writes finite values (n) at points (n,3) in cube coordinates, which reach `difference_step` beyond the
  /// cube.
  using Call = std::function<void(ConstPointsRef<float> points, Eigen::Ref<VectorF> values)>;
  explicit BatchFunction(Call call, const Frame& frame = {}) : call_(std::move(call)), frame_(frame) {}

  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override {
    call_(points, values);
  }
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override {
    call_(points, values);
    VectorF above(points.rows()), below(points.rows());
    for (int axis = 0; axis < 3; ++axis) {
      PointsF shifted = points;
      shifted.col(axis).array() += difference_step;
      call_(shifted, above);
      shifted.col(axis).array() -= 2.0f * difference_step;
      call_(shifted, below);
      gradients.col(axis) = (above - below) / (2.0f * difference_step);
    }
  }

  Frame frame() const override { return frame_; }

 private:
  static constexpr float difference_step = 1e-3f;

  Call call_;
  Frame frame_;
};

}  // namespace arapfields
