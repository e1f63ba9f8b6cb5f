// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/frame.h"
#include "core/types.h"

namespace arapfields {

/// A function Φ on the unit cube [-1,1]³ whose zero set is a surface: negative inside. Sampling and
/// extraction use this interface alone.
/// Both calls are batched and parallel, and may be made from one thread at a time for each object.
class ARAPFIELDS_EXPORT ImplicitFunction {
 public:
  virtual ~ImplicitFunction() = default;
  /// values (n) at points (n,3) in cube coordinates.
  virtual void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const = 0;
  /// The same with ∂Φ/∂x (n,3).
  virtual void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                        Eigen::Ref<PointsF> gradients) const = 0;
  /// A bound on |∇Φ| in the cube that holds everywhere, where one is known: 1 for a distance. Extraction then
  /// finds exactly the surface of the dense grid; else the bound is measured.
  virtual std::optional<double> gradient_bound() const { return std::nullopt; }
  /// Whether Φ is continuous. Where it is not, its sign may also change by a jump, and there is no surface
  /// there: extraction leaves the mesh open.
  virtual bool continuous() const { return true; }
  /// Where the cube lies in mesh coordinates; sampling and extraction answer in these.
  virtual Frame frame() const { return {}; }
};

}  // namespace arapfields
