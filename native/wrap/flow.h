// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/random.h"
#include "core/task.h"
#include "fields/composed_field.h"
#include "fields/radial_basis.h"
#include "mesh/surface_samples.h"
#include "options/wrap.h"
#include "wrap/correspondence.h"
#include "wrap/parameters.h"
#include "wrap/smooth_map.h"

namespace arapfields {

/// The stiffness terms of a moving surface: quadratic energies of its velocity v at n points.
struct MotionStiffness {
  Points points;                ///< (n,3) current positions
  RowMatrix<double> jacobians;  ///< (n,9), row-major: J of the motion since rest
  Vector rigidity;              ///< (n) weights of ‖∇v J − (R − J)‖², R the rotation closest to J
  Vector viscosity;             ///< (n) weights of ‖∇v‖²
  double ridge = 0.0;           ///< weight of the squared coefficients
  bool at_rest = false;         ///< points are those at rest and v is a change of the motion: ‖∇v − (R − J)‖²
};

/// Landmarks (k,3), their displacements onto their targets, and the weight of the mean squared difference.
struct LandmarkTerm {
  Points points, displacements;
  double weight = 0.0;
};

/// The velocity that minimises the sum of all terms: coefficients (basis.size(), 3) of a radial field. The
/// terms are quadratic, so one Cholesky factor of the normal equations solves them (docs/method.md, section
/// Wrap).
RowMatrix<double> solve_velocity(const RadialBasis& basis, const MotionStiffness& stiffness,
                                 const CorrespondenceTerms& correspondences, const LandmarkTerm& landmarks,
                                 const Progress& progress);

/// One stage of a wrap. Lengths are shares of the target's diagonal.
struct WrapStage {
  CorrespondenceWeights correspondences;
  double landmarks = 20.0;     ///< weight of the landmarks' mean squared distance
  double smoothness = 0.0;     ///< weight of distances along the surface to the smoothest map
  double rigidity = 1.0;       ///< weight of stretch and shear
  double viscosity = 0.1;      ///< weight of the velocity's gradient
  double center_radius = 0.5;  ///< of the radial functions
  Index centers = 60;          ///< their number
};

/// Weights of tangential distances, which limit sliding along the target.
struct SlidingSchedule {
  wrap_parameters::Schedule tangential = wrap_parameters::tangential_weight;
  bool is_smooth = true;  ///< in the last stage the surface follows the smoothest map through its places
};

/// The sliding of coarse wraps that judge landmarks.
constexpr SlidingSchedule coarse_sliding{wrap_parameters::coarse_tangential_weight, false};

/// The landmarks whose distances enter the flow's equations; the others move passively.
struct LandmarkPull {
  std::vector<Index> rows;  ///< which of the landmarks
  double weight = 0.0;      ///< of their mean squared distance, in the first stage
  double growth = 1.0;      ///< factor on the weight in the last stage
};

/// A surface that flows onto an aligned target, in the source's cube. Each step solves for a smooth velocity
/// that balances correspondences and landmarks against stiffness, and moves the surface by it. Steps are so
/// small that each is invertible: space never folds, and sheets do not pass through each other. Centers of
/// the velocity stand on both surfaces in their current positions.
class WrapFlow {
 public:
  /// Landmarks and their targets are (k,3). `target` must outlive the flow; where it has curvatures, the
  /// samples have their mesh.
  WrapFlow(const SurfaceSamples& samples, const WrapTarget& target, PointsIn landmarks,
           PointsIn landmark_targets, LandmarkPull pull, std::uint64_t seed, const Progress& progress = {});

  void step(const WrapStage& stage, const Progress& progress);
  /// All steps of all stages; `after` is called after each.
  void run(const WrapOptions& options, const Progress& progress, const std::function<void()>& after = {},
           const SlidingSchedule& sliding = {});
  const std::vector<FieldStep>& steps() const { return steps_; }
  double matched_share() const { return matched_share_; }
  /// Current positions (k,3) of the landmarks.
  const Points& landmarks() const { return landmarks_; }
  /// Mean ‖J − R‖² of some samples.
  double stretch() const;

 private:
  struct StepSamples;
  StepSamples draw_samples(Index count);
  /// Images of rest points under the smoothing spline through the samples' current places.
  Points smooth_places(PointsIn rest, const Progress& progress);
  RadialBasis basis(const WrapStage& stage, PointsIn points);
  void move(const RadialBasis& basis, RowMatrix<double> velocity, PointsIn points);

  const WrapTarget& target_;
  Random random_;
  Points rest_points_, rest_normals_, points_;  // of samples, in spatial order at rest
  RowMatrix<double> jacobians_;                 // (n,9), row-major
  Vector weights_, bend_weights_;
  RowMatrix<double> curvatures_;  // at rest
  Points landmarks_, landmark_targets_;
  LandmarkPull pull_;
  std::vector<Index> spline_rows_;
  std::optional<SmoothingSpline> spline_;  // of these samples, made at first use
  std::vector<FieldStep> steps_;
  double matched_share_ = 1.0;
};

/// Unit normals of a moved surface, from its unit rest normals and the motion's Jacobians (n,9), by the
/// cofactor matrix; `growth` (n) gets the area ratios.
Points moved_normals(const RowMatrix<double>& jacobians, PointsIn normals, Vector& growth);

}  // namespace arapfields
