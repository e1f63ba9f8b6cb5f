// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "fields/radial_field.h"

namespace arapfields {

/// One of the maps of a ComposedField, and how many times it is applied.
struct FieldStep {
  std::shared_ptr<const RadialField> map;
  int repeats = 1;
};

/// A composition of maps of the cube's space, as the flow of a velocity field is. Each map moves neighbours
/// by less than their distance, so that each is invertible, and so is the composition. Jets by the chain
/// rule. The maps' own frames are ignored.
class ARAPFIELDS_EXPORT ComposedField final : public DeformationField {
 public:
  /// Throws InvalidInput for a step without a map and for repeats below 1.
  explicit ComposedField(std::vector<FieldStep> steps);
  void evaluate(PointsIn points, JetView<double> out) const override;

  const std::vector<FieldStep>& steps() const { return steps_; }

 private:
  std::vector<FieldStep> steps_;
};

/// Jets of g(f(x)) in the place of those of f at x, from those of g at f(x); of the same count and order.
ARAPFIELDS_EXPORT_TO_TESTS void compose(JetView<const double> outer, JetView<double> inner);

}  // namespace arapfields
