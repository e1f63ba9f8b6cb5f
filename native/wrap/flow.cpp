// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/flow.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "distance/morton.h"
#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Samples that are followed; those that a step looks at, for each center, and their bounds.
constexpr Index followed = 9000, samples_a_center = 6, least_samples = 800, most_samples = 3000;
/// Places that centers are chosen from, for each.
constexpr Index places_a_center = 4;
/// How much a velocity may change from place to place within one of the motions that a step is made of, and
/// the most of these: below 1 each of them can be undone.
constexpr double gentle = 0.6;
constexpr int most_repeats = 4;
/// Weight of the squared coefficients, their lengths as shares of the target's diagonal.
constexpr double ridge = 1e-5;

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// The largest singular value of the velocity's gradient at any point.
double unevenness(const RadialBasis& basis, const RowMatrix<double>& velocity, PointsIn places) {
  JetBlock<double> jets(places.rows(), JetOrder::first);
  RadialEvaluator<double>(basis, places, JetOrder::first).evaluate(velocity, jets.view());
  double most = 0.0;
  for (Index i = 0; i < places.rows(); ++i) {
    Mat3 gradient;
    for (int k = 0; k < 3; ++k) gradient.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), i));
    Eigen::SelfAdjointEigenSolver<Mat3> solver;
    solver.computeDirect(gradient.transpose() * gradient, Eigen::EigenvaluesOnly);
    most = std::max(most, solver.eigenvalues()[2]);
  }
  return std::sqrt(most);
}

}  // namespace

Points moved_normals(const RowMatrix<double>& jacobians, PointsIn normals, Vector& growth) {
  Points result = normals;
  growth.resize(normals.rows());
  for (Index i = 0; i < normals.rows(); ++i) {
    const Mat3 jacobian = Eigen::Map<const RowMat3>(&jacobians(i, 0));
    Mat3 cofactors;
    for (int k = 0; k < 3; ++k) cofactors.col(k) = jacobian.col((k + 1) % 3).cross(jacobian.col((k + 2) % 3));
    const Vec3 normal = cofactors * normals.row(i).transpose();
    growth[i] = normal.norm();
    if (growth[i] > 0.0) result.row(i) = normal.transpose() / growth[i];
  }
  return result;
}

/// The samples that a step looks at: more where the surface has grown.
struct WrapFlow::Chosen {
  WrapPlaces surface;  // shares of the surface by its area then and at rest, half and half
  RowMatrix<double> jacobians;
  Vector rest_shares, grown_shares, weights, bend_weights;
};

WrapFlow::WrapFlow(const SurfaceSamples& samples, const WrapTarget& target, PointsIn landmarks, PointsIn ends,
                   std::uint64_t seed)
    : target_(target), random_(seed), landmarks_(landmarks), ends_(ends) {
  const std::vector<Index> taken = stratified(morton_order(samples.points), followed, random_);
  places_ = rows_of(samples.points, taken);
  rest_normals_ = rows_of(samples.normals, taken);
  if (samples.weights.size() > 0) weights_ = entries_of(samples.weights, taken);
  if (samples.bend_weights.size() > 0) bend_weights_ = entries_of(samples.bend_weights, taken);
  jacobians_.setZero(places_.rows(), 9);
  for (int k = 0; k < 3; ++k) jacobians_.col(4 * k).setOnes();
}

WrapFlow::Chosen WrapFlow::choose(Index count) {
  const Index all = places_.rows();
  Vector growth;
  const Points normals = moved_normals(jacobians_, rest_normals_, growth);
  const Vector density =
      0.5 * (growth / growth.sum()).array() + 0.5 / static_cast<double>(all);  // of which the sum is 1
  std::vector<Index> rows;
  double passed = random_.uniform() / static_cast<double>(count);
  double sum = 0.0;
  for (Index i = 0; i < all; ++i) {
    sum += density[i];
    if (sum <= passed) continue;
    rows.push_back(i);
    while (passed < sum) passed += 1.0 / static_cast<double>(count);
  }
  Chosen chosen;
  chosen.surface.places = rows_of(places_, rows);
  chosen.surface.normals = rows_of(normals, rows);
  chosen.jacobians = jacobians_(rows, Eigen::all);
  Vector stands = density(rows) * static_cast<double>(count);
  stands = stands.cwiseMin(1.0).cwiseInverse();
  chosen.rest_shares = stands / stands.sum();
  chosen.grown_shares = growth(rows).cwiseProduct(stands);
  chosen.grown_shares /= chosen.grown_shares.sum();
  chosen.surface.shares = 0.5 * (chosen.rest_shares + chosen.grown_shares);
  if (weights_.size() > 0) chosen.weights = entries_of(weights_, rows);
  if (bend_weights_.size() > 0) chosen.bend_weights = entries_of(bend_weights_, rows);
  return chosen;
}

RadialBasis WrapFlow::basis(const WrapStage& stage, PointsIn places) {
  const Index each = places_a_center * stage.centers / 2;
  const std::vector<Index> here = random_subset(places.rows(), each, random_);
  const std::vector<Index> there = random_subset(target_.points.rows(), each, random_);
  Points from(static_cast<Index>(here.size() + there.size()), 3);
  from << rows_of(places, here), rows_of(target_.points, there);
  RadialBasis basis;
  basis.centers = rows_of(from, farthest_points(from, stage.centers).indices);
  basis.radii = Vector::Constant(basis.centers.rows(), stage.reach * target_.diagonal);
  return basis;
}

void WrapFlow::follow(const RadialBasis& basis, RowMatrix<double> velocity, PointsIn places) {
  Points judged(places.rows() + basis.center_count(), 3);
  judged << places, basis.centers;
  const double most = unevenness(basis, velocity, judged);
  const int repeats = std::clamp(static_cast<int>(std::ceil(most / gentle)), 1, most_repeats);
  velocity *= std::min(1.0, gentle * repeats / std::max(most, 1e-12)) / repeats;
  velocity += basis.identity();
  FieldStep step{std::make_shared<RadialField>(basis, std::move(velocity)), repeats};
  const Index n = places_.rows(), marks = landmarks_.rows();
  JetBlock<double> jets(n, JetOrder::first);
  for (int repeat = 0; repeat < repeats; ++repeat) {
    RadialEvaluator<double>(basis, places_, JetOrder::first).evaluate(step.map->coefficients(), jets.view());
    for (Index i = 0; i < n; ++i) {
      places_.row(i) = Eigen::Map<const Vec3>(jets.view().at(0, i));
      RowMat3 gradient;
      for (int k = 0; k < 3; ++k)
        gradient.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), i));
      Eigen::Map<RowMat3> jacobian(&jacobians_(i, 0));
      jacobian = (gradient * jacobian).eval();
    }
    if (marks == 0) continue;
    Points there(marks, 3);
    RadialEvaluator<double>(basis, landmarks_, JetOrder::value)
        .evaluate(step.map->coefficients(), {there.data(), marks, JetOrder::value});
    landmarks_ = there;
  }
  steps_.push_back(std::move(step));
}

void WrapFlow::step(const WrapStage& stage, const Progress& progress) {
  const double unit = 1.0 / (target_.diagonal * target_.diagonal);
  const Chosen chosen = choose(std::clamp(samples_a_center * stage.centers, least_samples, most_samples));
  WrapPull pull = stage.pull;
  pull.weight *= unit;
  const WrapForces forces(target_, chosen.surface, pull);
  matched_share_ = forces.matched_share;
  progress.report(0.2);
  WrapMotion motion{chosen.surface.places, chosen.jacobians, stage.rigid * chosen.rest_shares,
                    stage.viscous * chosen.grown_shares, ridge * unit};
  if (!target_.closed)  // what has no counterpart stays as stiff as at first
    motion.rigid =
        chosen.rest_shares.array() * (stage.rigid + (1.0 - stage.rigid) * (1.0 - forces.agreements.array()));
  if (chosen.weights.size() > 0) motion.rigid = motion.rigid.cwiseProduct(chosen.weights);
  if (chosen.bend_weights.size() > 0) motion.viscous = motion.viscous.cwiseProduct(chosen.bend_weights);
  const WrapMarks marks{landmarks_, ends_ - landmarks_, stage.landmarks * unit};
  const RadialBasis centers = basis(stage, chosen.surface.places);
  follow(centers, solve_velocity(centers, motion, forces, marks, progress.part(0.2, 0.8)),
         chosen.surface.places);
  progress.report(1.0);
}

}  // namespace arapfields
