// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"
#include "fields/composed_field.h"
#include "mesh/surface_samples.h"
#include "options/wrap.h"
#include "wrap/system.h"

namespace arapfields {

/// One stage: what draws and what resists. Lengths as shares of the target's diagonal.
struct WrapStage {
  WrapPull pull;
  double landmarks = 20.0;  ///< weight of their mean squared distance
  double rigid = 1.0;       ///< weight of the resistance to stretching and shearing
  double viscous = 0.1;     ///< weight of the resistance to flowing unevenly
  double reach = 0.5;       ///< radius of a center
  Index centers = 60;
};

/// A surface that flows onto a target, in the source's cube, onto which the target has been aligned: each
/// step finds the smooth velocity that answers best to what draws and to what the surface, as it was at rest,
/// resists, and follows it so gently that neighbours stay neighbours: no step folds space, so that sheets do
/// not pass through each other. Centers stand on both surfaces as they lie at that moment.
class WrapFlow {
 public:
  /// Landmarks and their ends are (k,3). `target` must outlive it.
  WrapFlow(const SurfaceSamples& samples, const WrapTarget& target, PointsIn landmarks, PointsIn ends,
           std::uint64_t seed);

  void step(const WrapStage& stage, const Progress& progress);
  const std::vector<FieldStep>& steps() const { return steps_; }
  double matched_share() const { return matched_share_; }
  /// (k,3) where the landmarks have come to.
  const Points& landmarks() const { return landmarks_; }

 private:
  struct Chosen;
  Chosen choose(Index count);
  RadialBasis basis(const WrapStage& stage, PointsIn places);
  void follow(const RadialBasis& basis, RowMatrix<double> velocity, PointsIn places);

  const WrapTarget& target_;
  Random random_;
  Points rest_normals_, places_;  // of samples, neighbours at rest beside each other
  RowMatrix<double> jacobians_;   // (n,9), row-major
  Vector weights_, bend_weights_;
  Points landmarks_, ends_;
  std::vector<FieldStep> steps_;
  double matched_share_ = 1.0;
};

/// Unit normals of a surface whose unit normals at rest were these, by its motion's Jacobians (n,9), and how
/// its areas have grown.
Points moved_normals(const RowMatrix<double>& jacobians, PointsIn normals, Vector& growth);

}  // namespace arapfields
