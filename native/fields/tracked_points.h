// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/frame.h"
#include "fields/influence.h"
#include "fields/radial_evaluator.h"

namespace arapfields {

/// Points of mesh coordinates, a mesh's vertices say, that radial fields of one basis move again and again;
/// in any order, in single precision.
class TrackedPoints {
 public:
  TrackedPoints() = default;
  TrackedPoints(const RadialBasis& basis, const Frame& frame, PointsIn mesh_points);
  /// What moves them only so far; null: nothing.
  void set_influence(const std::shared_ptr<const Influence>& influence);
  /// Where the field with these coefficients takes them, (n,3) in mesh coordinates.
  PointsF moved(const RowMatrix<double>& coefficients) const;
  /// Mesh coordinates at rest.
  const Points& rest() const { return rest_; }
  Index size() const { return evaluator_.size(); }

 private:
  Frame frame_;
  std::vector<std::uint32_t> order_;
  RadialEvaluator<float> evaluator_;
  Points rest_;  // mesh coordinates
  std::shared_ptr<const Influence> influence_;
  Vector shares_;  // of the motion; empty: all of it
};

}  // namespace arapfields
