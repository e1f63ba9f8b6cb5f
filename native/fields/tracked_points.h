// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/frame.h"
#include "fields/influence.h"
#include "fields/radial_evaluator.h"

namespace arapfields {

/// Fixed points in mesh coordinates, such as a mesh's vertices, at which radial fields of one basis are
/// evaluated repeatedly, in single precision.
class TrackedPoints {
 public:
  TrackedPoints() = default;
  /// `triangles`: those of the mesh whose vertices the points are; null: not known.
  TrackedPoints(const RadialBasis& basis, const Frame& frame, PointsIn mesh_points,
                std::shared_ptr<const Triangles> triangles = nullptr);
  /// Limits the motion; null: not.
  void set_influence(const std::shared_ptr<const Influence>& influence);
  /// Positions (n,3) under the field with these coefficients, in mesh coordinates.
  PointsF moved(const RowMatrix<double>& coefficients) const;
  /// Mesh coordinates at rest.
  const Points& rest() const { return rest_; }
  const std::shared_ptr<const Triangles>& triangles() const { return triangles_; }
  Index size() const { return evaluator_.size(); }

 private:
  Frame frame_;
  std::vector<std::uint32_t> order_;
  RadialEvaluator<float> evaluator_;
  Points rest_;  // mesh coordinates
  std::shared_ptr<const Triangles> triangles_;
  std::shared_ptr<const Influence> influence_;
  Vector shares_;  // influence m at the points; empty: all 1
};

}  // namespace arapfields
