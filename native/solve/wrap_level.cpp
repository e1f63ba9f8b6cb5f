// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/wrap_level.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "fields/radial_evaluator.h"
#include "solve/live_setup.h"
#include "solve/live_stiffness.h"
#include "solve/surface_stiffness.h"

namespace arapfields {
namespace {

/// Samples a center that the energy is judged at, and points of the target a sample.
constexpr Index samples_a_center = 8;
constexpr double targets_a_sample = 1.5;
/// Radii of coarse and of fine centers, as multiples of their spacing; fine ones a coarse one.
constexpr double coarse_radius = 3.0, fine_radius = 4.0;
constexpr Index fine_a_coarse = 5;
/// Samples that stand for the pull in the preconditioner.
constexpr Index pulled_samples = 2000;
/// Steps between two looks at what belongs to what.
constexpr Index steps_at_once = 6;
constexpr double tolerance = 1e-4, floor = 1e-12;

Points deformed_normals(JetView<const double> jets, PointsIn normals, Vector& growth) {
  Points result(jets.count, 3);
  growth.resize(jets.count);
  for (Index i = 0; i < jets.count; ++i) {
    Mat3 jacobian, cofactors;
    for (int k = 0; k < 3; ++k) jacobian.col(k) = Eigen::Map<const Vec3>(jets.at(first_column(k), i));
    for (int k = 0; k < 3; ++k) cofactors.col(k) = jacobian.col((k + 1) % 3).cross(jacobian.col((k + 2) % 3));
    const Vec3 normal = cofactors * normals.row(i).transpose();
    const double length = normal.norm();
    result.row(i) = normals.row(i);
    growth[i] = length;
    if (length > 0.0) result.row(i) = normal.transpose() / length;
  }
  return result;
}

}  // namespace

WrapPlaces::WrapPlaces(const RadialEvaluator<double>& field, const RowMatrix<double>& coefficients,
                       PointsIn rest_normals) {
  JetBlock<double> jets(field.size(), JetOrder::first);
  field.evaluate(coefficients, jets.view());
  places = Eigen::Map<const Points>(jets.view().data, field.size(), 3);
  normals = deformed_normals(jets.view(), rest_normals, growth);
  distortion = arapfields::distortion<double>(jets.view());
}

WrapLevel::WrapLevel(const SurfaceSamples& samples, const RestShape& shape, const WrapTarget& target,
                     PointsIn landmarks, PointsIn ends, const WrapOptions& options, Index centers)
    : options_(options), landmarks_(landmarks), ends_(ends) {
  Random random(static_cast<std::uint64_t>(options.seed));
  const std::vector<Index> chosen = stratified(shape.order, samples_a_center * centers, random);
  points_ = rows_of(samples.points, chosen);
  normals_ = rows_of(samples.normals, chosen);
  target_ = target.thinned(static_cast<Index>(targets_a_sample * static_cast<double>(points_.rows())));
  basis_ = radial_basis(
      shape.sites,
      {{std::max<Index>(1, centers / fine_a_coarse), coarse_radius}, {centers, fine_radius, true}},
      shape.layout);
  basis_.set_embedding(shape.embedding);
  field_ = std::make_unique<RadialEvaluator<double>>(basis_, points_, JetOrder::first);
  bending_ = SurfaceStiffness(shape.thickness, options.surface).bending(points_);
  weights_.resize(samples.weights.size() > 0 ? points_.rows() : 0);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const auto row = static_cast<Index>(i);
    if (weights_.size() > 0) weights_[row] = samples.weights[chosen[i]];
    if (samples.bend_weights.size() > 0) bending_[row] *= samples.bend_weights[chosen[i]];
  }
  terms_ = std::make_shared<WrapTerms>(target_, points_, normals_);
  objective_ = std::make_unique<LiveObjective<float>>(basis_, points_, 1.0);
  objective_->set_barrier(options.surface.barrier, options.surface.barrier_threshold);
  objective_->set_hooks({{terms_}, 1.0, {}}, points_);
  landmark_values_ = landmarks_.rows() > 0 ? radial_rows(basis_, landmarks_, JetOrder::value)
                                           : RowMatrix<double>(0, basis_.size());
  Points some(std::min<Index>(pulled_samples, points_.rows()), 3);
  for (Index i = 0; i < some.rows(); ++i) some.row(i) = points_.row(i * points_.rows() / some.rows());
  place_values_ = radial_rows(basis_, some, JetOrder::value);
}

/// What has no counterpart on an open target stays as stiff as in the first stage.
Vector WrapLevel::bending(const WrapStage& stage) const {
  if (target_.closed) return stage.bending * bending_;
  const auto factor = stage.bending + (1.0 - stage.bending) * (1.0 - terms_->agreements().array());
  return bending_.array() * factor;
}

/// By samples' bending; on a closed target that is a factor times the same at every stage.
RowMatrix<double> WrapLevel::stiffness(double factor, const Vector& bending, const Progress& progress) {
  if (!target_.closed) return stiffness_matrix(basis_, points_, bending, weights_, progress);
  if (stretching_.size() == 0) {
    const Vector none = Vector::Zero(points_.rows());
    stretching_ = stiffness_matrix(basis_, points_, none, weights_, progress.part(0.0, 0.5));
    bent_ = stiffness_matrix(basis_, points_, bending_, weights_, progress.part(0.5, 1.0)) - stretching_;
  }
  return stretching_ + factor * bent_;
}

void WrapLevel::factorise(const WrapStage& stage, const Progress& progress) {
  const Index marks = landmarks_.rows(), places = place_values_.rows();
  const Vector lambda = bending(stage);
  RowMatrix<double> values(marks + places, basis_.size());
  values << landmark_values_, place_values_;
  Vector shares(marks + places);
  const double pull = 0.5 * (1.0 + stage.pull.coverage) * stage.pull.weight;
  shares << Vector::Constant(marks, stage.landmarks / static_cast<double>(std::max<Index>(1, marks))),
      Vector::Constant(places, pull / static_cast<double>(places));
  objective_->set_stiffness(lambda, weights_);
  objective_->set_handles({landmarks_, ends_, shares.head(marks)}, landmark_values_,
                          inverse_factor(stiffness(stage.bending, lambda, progress), values, shares));
}

Index WrapLevel::descend(const WrapStage& stage, RowMatrix<double>& coefficients, const Progress& progress) {
  const auto match = [&] {
    const WrapPlaces now(*field_, coefficients, normals_);
    terms_->match(now.places, now.normals, stage.pull);
  };
  match();
  factorise(stage, progress.part(0.0, 0.2));
  QuasiNewton optimizer;
  VectorF u;
  Index steps = 0;
  const Index most = options_.iterations;
  for (Index done = 0; done < most; done += steps_at_once) {
    const auto share = [&](Index count) {
      return 0.2 + 0.8 * static_cast<double>(count) / static_cast<double>(most);
    };
    if (done > 0) match();
    const Index next = std::min(most, done + steps_at_once);
    const QuasiNewtonReport found =
        optimizer.minimise(*objective_, {next - done, tolerance, floor}, coefficients, u,
                           progress.part(share(done), share(next)));
    steps += found.iterations;
  }
  return steps;
}

}  // namespace arapfields
