// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "energies/distortion.h"
#include "fields/radial_evaluator.h"
#include "options/wrap.h"
#include "solve/live_objective.h"
#include "solve/rest_shape.h"
#include "solve/wrap_pull.h"

namespace arapfields {

/// Where points and their unit normals come to by a field, and how far it is from a fold there.
struct WrapPlaces {
  Points places, normals;
  Vector growth;  ///< of areas there, against those at rest
  Distortion distortion;
  /// `field` evaluates at points with these normals at rest, at first order or more.
  WrapPlaces(const RadialEvaluator<double>& field, const RowMatrix<double>& coefficients,
             PointsIn rest_normals);
};

/// One stage: what draws and what resists.
struct WrapStage {
  WrapPull pull;
  double landmarks = 20.0;  ///< weight of their mean squared distance
  double bending = 1.0;     ///< factor of the resistance
};

/// What a wrap is solved with: a field of so many centers, the samples that it is judged at and the points of
/// the target that draw them. All in the source's cube, onto which the target has been aligned.
class WrapLevel {
 public:
  /// So many fine centers, and a fifth as many coarse ones. Landmarks and their ends are (k,3). `target` and
  /// `options` must outlive it.
  WrapLevel(const SurfaceSamples& samples, const RestShape& shape, const WrapTarget& target,
            PointsIn landmarks, PointsIn ends, const WrapOptions& options, Index centers);

  /// Improves coefficients (basis().size(), 3) and returns the steps taken.
  Index descend(const WrapStage& stage, RowMatrix<double>& coefficients, const Progress& progress);
  const RadialBasis& basis() const { return basis_; }
  double matched_share() const { return terms_->matched_share(); }

 private:
  Vector bending(const WrapStage& stage) const;
  RowMatrix<double> stiffness(double factor, const Vector& bending, const Progress& progress);
  void factorise(const WrapStage& stage, const Progress& progress);

  const WrapOptions& options_;
  WrapTarget target_;
  RadialBasis basis_;
  Points points_, normals_, landmarks_, ends_;
  Vector bending_, weights_;
  std::unique_ptr<RadialEvaluator<double>> field_;  // at the samples
  RowMatrix<double> stretching_, bent_;             // of a closed target: stiffness without and by bending
  std::unique_ptr<LiveObjective<float>> objective_;
  std::shared_ptr<WrapTerms> terms_;
  RowMatrix<double> landmark_values_, place_values_;
};

}  // namespace arapfields
