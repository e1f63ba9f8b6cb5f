// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/flow.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/jacobians.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "fields/radial_evaluator.h"
#include "mesh/sample_mesh.h"
#include "sampling/sample_choice.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;
// Tuned on pairs with a known map, such that unlike shapes come as near to their targets as without
// smoothing.

/// Weight in the last stage of tangential distances to the smoothing spline through the surface's current
/// places (SmoothingSpline), relative to correspondences: it removes tangential noise.
constexpr double smooth_weight = 0.6;
/// Places that the spline fits, and its smoothing parameter there.
constexpr Index map_places = 1000;
constexpr double smoothing = 1e-3;
/// Distance from the spline, as a fraction of the diagonal, at which its weight is a quarter: larger ones
/// occur where sheets of the surface separate.
constexpr double smooth_distance = 0.002;

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// t: 0 in the first stage, 1 in the last.
WrapStage stage_at(double t, const WrapOptions& options, const LandmarkPull& pull,
                   const SlidingSchedule& sliding) {
  const auto most_centers = static_cast<double>(options.centers);
  const Schedule closeness{correspondence_weight.first, correspondence_weight.last * options.closeness},
      centers{std::min(first_centers, most_centers), most_centers};
  WrapStage stage;
  stage.correspondences = {.weight = closeness.at(t),
                           .coverage = coverage * options.coverage,
                           .normals = options.normal_weight,
                           .tangential = sliding.tangential.at(t),
                           .curvature = curvature_weight * std::pow(t, 4),
                           .unoriented = unoriented_weight * t * t};
  stage.landmarks = pull.weight * std::pow(pull.growth, t);
  stage.smoothness = t < 1.0 || !sliding.is_smooth ? 0.0 : smooth_weight;
  stage.rigidity = rigidity.at(t);
  stage.viscosity = viscosity * options.bending;
  stage.center_radius = center_radius.at(t);
  stage.centers = static_cast<Index>(std::round(centers.at(t)));
  return stage;
}

/// The squared singular values, ascending.
Vec3 squared_singular_values(const Mat3& matrix) {
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(matrix.transpose() * matrix, Eigen::EigenvaluesOnly);
  return solver.eigenvalues();
}

/// The largest singular value of the velocity's gradient over the points.
double gradient_norm(const RadialBasis& basis, const RowMatrix<double>& velocity, PointsIn points) {
  JetBlock<double> jets(points.rows(), JetOrder::first);
  RadialEvaluator<double>(basis, points, JetOrder::first).evaluate(velocity, jets.view());
  double largest = 0.0;
  for (Index i = 0; i < points.rows(); ++i) {
    const Mat3 gradient = jacobian_at(std::as_const(jets).view(), i);
    largest = std::max(largest, squared_singular_values(gradient)[2]);
  }
  return std::sqrt(largest);
}

}  // namespace

Points moved_normals(const RowMatrix<double>& jacobians, PointsIn normals, Vector& growth) {
  Points result = normals;
  growth.resize(normals.rows());
  for (Index i = 0; i < normals.rows(); ++i) {
    const Mat3 jacobian = Eigen::Map<const RowMat3>(&jacobians(i, 0));
    const Vec3 normal = cofactors(jacobian) * normals.row(i).transpose();
    growth[i] = normal.norm();
    if (growth[i] > 0.0) result.row(i) = normal.transpose() / growth[i];
  }
  return result;
}

/// The samples in one step's equations, with a density between those of the rest area and the current area.
struct WrapFlow::StepSamples {
  SurfacePoints surface;  // area weights: the mean of those at rest and now
  RowMatrix<double> jacobians;
  Points rest;
  Vector rest_area_weights, current_area_weights, weights, bend_weights;
};

WrapFlow::WrapFlow(const SurfaceSamples& samples, const WrapTarget& target, PointsIn landmarks,
                   PointsIn landmark_targets, LandmarkPull pull, std::uint64_t seed, const Progress& progress)
    : target_(target),
      random_(seed),
      landmarks_(landmarks),
      landmark_targets_(landmark_targets),
      pull_(std::move(pull)) {
  const std::vector<Index> rows = stratified(morton_order(samples.points), moved_samples, random_);
  points_ = rows_of(samples.points, rows);
  rest_points_ = points_;
  rest_normals_ = rows_of(samples.normals, rows);
  if (samples.weights.size() > 0) weights_ = entries_of(samples.weights, rows);
  if (samples.bend_weights.size() > 0) bend_weights_ = entries_of(samples.bend_weights, rows);
  if (target_.curvature.values.size() > 0) {
    const SurfaceSamples all =
        sample_mesh(samples.mesh->vertices, samples.mesh->triangles, curvature_samples, seed);
    curvatures_ = curvature_values(samples.frame.to_cube(all.frame.to_mesh(all.points)), all.normals, points_,
                                   rest_normals_, target_.curvature.radius, progress);
  }
  jacobians_.setZero(points_.rows(), 9);
  for (int k = 0; k < 3; ++k) jacobians_.col(4 * k).setOnes();
}

/// Stratified sampling of about `count` points, half by the area at rest and half by the current area.
WrapFlow::StepSamples WrapFlow::draw_samples(Index count) {
  const Index all = points_.rows();
  Vector growth;
  const Points normals = moved_normals(jacobians_, rest_normals_, growth);
  const Vector density = 0.5 * (growth / growth.sum()).array() + 0.5 / static_cast<double>(all);  // sums to 1
  std::vector<Index> rows;
  double passed = random_.uniform() / static_cast<double>(count);
  double sum = 0.0;
  for (Index i = 0; i < all; ++i) {
    sum += density[i];
    if (sum <= passed) continue;
    rows.push_back(i);
    while (passed < sum) passed += 1.0 / static_cast<double>(count);
  }

  StepSamples chosen;
  chosen.surface.points = rows_of(points_, rows);
  chosen.surface.normals = rows_of(normals, rows);
  chosen.rest = rows_of(rest_points_, rows);
  chosen.jacobians = jacobians_(rows, Eigen::all);
  if (curvatures_.size() > 0)
    chosen.surface.curvatures =  // curvature scales with the inverse length
        growth(rows).array().rsqrt().matrix().asDiagonal() * curvatures_(rows, Eigen::all);
  Vector represented = density(rows) * static_cast<double>(count);
  represented = represented.cwiseMin(1.0).cwiseInverse();
  chosen.rest_area_weights = represented / represented.sum();
  chosen.current_area_weights = growth(rows).cwiseProduct(represented);
  chosen.current_area_weights /= chosen.current_area_weights.sum();
  chosen.surface.area_weights = 0.5 * (chosen.rest_area_weights + chosen.current_area_weights);
  if (weights_.size() > 0) chosen.weights = entries_of(weights_, rows);
  if (bend_weights_.size() > 0) chosen.bend_weights = entries_of(bend_weights_, rows);
  return chosen;
}

Points WrapFlow::smooth_places(PointsIn rest, const Progress& progress) {
  if (!spline_) {
    spline_rows_ = farthest_points(rest_points_, map_places).indices;
    const auto count = static_cast<Index>(spline_rows_.size());
    spline_.emplace(rows_of(rest_points_, spline_rows_), Vector::Constant(count, smoothing), progress);
  }
  return spline_->fit(rows_of(points_, spline_rows_)).at(rest);
}

/// Centers at farthest-point samples of both surfaces together.
RadialBasis WrapFlow::basis(const WrapStage& stage, PointsIn points) {
  const Index each = candidates_a_center * stage.centers / 2;
  const std::vector<Index> source_rows = random_subset(points.rows(), each, random_);
  const std::vector<Index> target_rows = random_subset(target_.points.rows(), each, random_);
  Points candidates(static_cast<Index>(source_rows.size() + target_rows.size()), 3);
  candidates << rows_of(points, source_rows), rows_of(target_.points, target_rows);
  RadialBasis basis;
  basis.centers = rows_of(candidates, farthest_points(candidates, stage.centers).indices);
  basis.radii = Vector::Constant(basis.centers.rows(), stage.center_radius * target_.diagonal);
  return basis;
}

void WrapFlow::move(const RadialBasis& basis, RowMatrix<double> velocity, PointsIn points) {
  // Split and shorten the motion until it is invertible.
  Points tested(points.rows() + basis.center_count(), 3);
  tested << points, basis.centers;
  const double largest = gradient_norm(basis, velocity, tested);
  const int repeats = std::clamp(static_cast<int>(std::ceil(largest / largest_gradient)), 1, most_substeps);
  velocity *= std::min(1.0, largest_gradient * repeats / std::max(largest, 1e-12)) / repeats;
  velocity += basis.identity();
  FieldStep step{std::make_shared<RadialField>(basis, std::move(velocity)), repeats};

  // Move samples, their Jacobians and landmarks.
  const Index n = points_.rows(), landmark_count = landmarks_.rows();
  JetBlock<double> jets(n, JetOrder::first);
  for (int repeat = 0; repeat < repeats; ++repeat) {
    RadialEvaluator<double>(basis, points_, JetOrder::first).evaluate(step.map->coefficients(), jets.view());
    for (Index i = 0; i < n; ++i) {
      points_.row(i) = Eigen::Map<const Vec3>(jets.view().at(0, i));
      RowMat3 gradient;
      for (int k = 0; k < 3; ++k)
        gradient.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), i));
      Eigen::Map<RowMat3> jacobian(&jacobians_(i, 0));
      jacobian = (gradient * jacobian).eval();
    }
    if (landmark_count == 0) continue;
    Points moved(landmark_count, 3);
    RadialEvaluator<double>(basis, landmarks_, JetOrder::value)
        .evaluate(step.map->coefficients(), {moved.data(), landmark_count, JetOrder::value});
    landmarks_ = moved;
  }
  steps_.push_back(std::move(step));
}

void WrapFlow::step(const WrapStage& stage, const Progress& progress) {
  const double unit = 1.0 / (target_.diagonal * target_.diagonal);
  const StepSamples samples =
      draw_samples(std::clamp(samples_a_center * stage.centers, least_samples, most_samples));

  // Correspondences.
  CorrespondenceWeights weights = stage.correspondences;
  weights.weight *= unit;
  CorrespondenceTerms correspondences(target_, samples.surface, weights);
  if (stage.smoothness > 0.0)
    correspondences.add_along(samples.surface, smooth_places(samples.rest, progress),
                              stage.smoothness * weights.weight * (1.0 + weights.coverage),
                              smooth_distance * target_.diagonal);
  matched_share_ = correspondences.matched_share;
  progress.report(0.2);

  // Stiffness. On an open target, parts without a counterpart keep the rigidity of the first stage.
  MotionStiffness stiffness{samples.surface.points, samples.jacobians,
                            stage.rigidity * samples.rest_area_weights,
                            stage.viscosity * samples.current_area_weights, ridge * unit};
  if (!target_.closed)
    stiffness.rigidity =
        samples.rest_area_weights.array() *
        (stage.rigidity + (1.0 - stage.rigidity) * (1.0 - correspondences.match_weights.array()));
  if (samples.weights.size() > 0) stiffness.rigidity = stiffness.rigidity.cwiseProduct(samples.weights);
  if (samples.bend_weights.size() > 0)
    stiffness.viscosity = stiffness.viscosity.cwiseProduct(samples.bend_weights);

  // Velocity, and the motion along it.
  const LandmarkTerm landmarks{rows_of(landmarks_, pull_.rows),
                               rows_of(landmark_targets_ - landmarks_, pull_.rows), stage.landmarks * unit};
  const RadialBasis centers = basis(stage, samples.surface.points);
  move(centers, solve_velocity(centers, stiffness, correspondences, landmarks, progress.part(0.2, 0.8)),
       samples.surface.points);
  progress.report(1.0);
}

void WrapFlow::run(const WrapOptions& options, const Progress& progress, const std::function<void()>& after,
                   const SlidingSchedule& sliding) {
  const double all = options.stages * options.iterations;
  for (int done = 0; done < all; ++done) {
    const int stage = done / options.iterations;
    const double t = options.stages > 1 ? static_cast<double>(stage) / (options.stages - 1) : 1.0;
    step(stage_at(t, options, pull_, sliding), progress.part(done / all, (done + 1) / all));
    if (after) after();
  }
}

double WrapFlow::stretch() const {
  const Index all = points_.rows(), count = std::min(all, stretch_samples);
  double sum = 0.0;
  for (Index k = 0; k < count; ++k) {
    const Mat3 jacobian = Eigen::Map<const RowMat3>(&jacobians_(k * all / count, 0));
    sum += (squared_singular_values(jacobian).array().max(0.0).sqrt() - 1.0).square().sum();
  }
  return sum / static_cast<double>(count);
}

}  // namespace arapfields
