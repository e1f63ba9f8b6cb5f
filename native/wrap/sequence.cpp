// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/sequence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/task.h"
#include "distance/morton.h"
#include "sampling/sample_choice.h"
#include "solve/setup.h"
#include "solve/warnings.h"
#include "wrap/flow.h"
#include "wrap/measure.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

// Tuned on scans of a body that moves one arm, with and without noise.

/// Weight of the mean squared distance between corresponding points, times the option closeness, relative to
/// that of ‖∇v − (R − J)‖².
constexpr double sequence_closeness = 150.0;
/// Weight of the change's ‖∇v‖², times the option bending.
constexpr double sequence_viscosity = 0.05;
/// Samples of the surface.
constexpr Index sequence_samples = 4000;
/// Coarse centers, and fine ones as a share of the option centers; radii in multiples of their spacing.
constexpr Index sequence_coarse_centers = 60;
constexpr double sequence_centers = 0.5;
constexpr double sequence_coarse_radius = 3.0;
constexpr double sequence_fine_radius = 4.0;
/// Last rounds in which points are held in place: the weight relative to that of correspondences, and the
/// motion at which it falls to a quarter, in mean distances of the surface to the frame.
constexpr int held_rounds = 2;
constexpr double held_weight = 10.0;
constexpr double held_distance = 2.5;

/// Adds springs from points to their positions `last` (n,3) in the last frame, with weights that fall off
/// with the motion, so that noise alone does not move them. `closeness` is the weight of correspondences.
void hold(const WrapTarget& target, const SurfacePoints& now, PointsIn last, double normal_weight,
          double closeness, CorrespondenceTerms& pull) {
  const std::vector<Index> nearest = target.tree.nearest(now.points, now.normals, normal_weight);
  double off = 0.0;  // the mean distance along normals
  for (Index i = 0; i < now.points.rows(); ++i)
    off += now.area_weights[i] *
           std::abs((target.points.row(nearest[i]) - now.points.row(i)).dot(now.normals.row(i)));
  if (!(off > 0.0)) return;
  for (Index i = 0; i < now.points.rows(); ++i) {
    const Eigen::RowVector3d back = last.row(i) - now.points.row(i);
    const double share = std::pow(1.0 + back.squaredNorm() / std::pow(held_distance * off, 2), -2);
    const double weight = held_weight * closeness * share * now.area_weights[i];
    pull.forms.row(i).head<3>().array() += weight;
    pull.right_hand_sides.row(i) += weight * back;
  }
}

}  // namespace

WrapSequence::WrapSequence(const SurfaceSamples& samples, const DeformationField& field,
                           const WrapOptions& options)
    : options_(options), frame_(samples.frame) {
  options.validate();
  require_samples(samples);
  require(samples.normals.rows() == samples.size(), "samples", "they have no normals",
          "a sequence needs one a sample");
  const auto* composed = dynamic_cast<const ComposedField*>(&field);
  require(composed != nullptr, "field", "it is no field of wrap", "the wrap of the first frame is needed");
  require(field.frame() == frame_, "field", "it was found for other samples",
          "the samples of the first frame's wrap are needed");
  first_ = composed->steps();
  // The last step of a wrap is affine, that of a later frame has centers.
  std::shared_ptr<const RadialField> last;
  if (!first_.empty() && first_.back().map->basis().center_count() > 0) {
    last = first_.back().map;
    first_.pop_back();
  }
  kept_ = field.rest_points();
  Random random(static_cast<std::uint64_t>(options.seed));
  const std::vector<Index> rows = stratified(morton_order(samples.points), sequence_samples, random);
  const MovedSurface surface(ComposedField(first_), rows_of(samples.points, rows),
                             rows_of(samples.normals, rows));
  points_ = surface.points;
  normals_ = surface.normals;
  areas_ = surface.growth / surface.growth.sum();
  weights_ = samples.weights.size() > 0 ? entries_of(samples.weights, rows) : Vector::Ones(points_.rows());
  const auto centers = static_cast<Index>(sequence_centers * options.centers);
  basis_ = radial_basis(points_, {{std::min(sequence_coarse_centers, centers), sequence_coarse_radius},
                                  {centers, sequence_fine_radius}});
  basis_.set_embedding(interior_embedding(points_, normals_));
  coefficients_ = last ? last->coefficients() : basis_.identity();
  const Points& centers_of_last = last ? last->basis().centers : basis_.centers;
  require(centers_of_last.rows() == basis_.centers.rows() && centers_of_last == basis_.centers, "field",
          "it was found with other samples or options", "those of its sequence are needed");
}

WrapSolution WrapSequence::next(const ImplicitFunction& function, const Progress& progress) {
  const std::lock_guard lock(one_at_a_time_);
  const Stopwatch watch;
  const ThreadScope threads(options_.threads);
  const WrapTarget mesh_target = wrap_target(
      function, target_samples, static_cast<std::uint64_t>(options_.seed), progress.part(0.0, 0.2));
  const WrapTarget target =
      mesh_target.transformed_back({.scale = frame_.scale, .translation = frame_.center});
  const WrapTarget some = target.subsample(flow_target_samples);
  const double unit = 1.0 / (target.diagonal * target.diagonal);
  const double closeness = sequence_closeness * options_.closeness * unit;
  WrapSolution solution;
  WrapReport& report = solution.report;

  RowMatrix<double> coefficients = coefficients_;
  const Points last = RadialField(basis_, coefficients_).at(points_);
  const int rounds = options_.iterations;
  for (int round = 0; round < rounds; ++round) {
    const Progress part = progress.part(0.2 + 0.7 * round / rounds, 0.2 + 0.7 * (round + 1) / rounds);
    const MovedSurface now(RadialField(basis_, coefficients), points_, normals_);
    Vector areas = areas_.cwiseProduct(now.growth);
    areas /= areas.sum();
    const SurfacePoints surface{now.points, now.normals, areas};
    CorrespondenceTerms pull(some, surface,
                             {.weight = closeness,
                              .coverage = coverage * options_.coverage,
                              .normals = options_.normal_weight,
                              .tangential = tangential_weight.last,
                              .unoriented = 0.0});
    report.matched_share = pull.matched_share;
    if (round >= rounds - held_rounds)
      hold(some, surface, last, options_.normal_weight, closeness * (1.0 + coverage * options_.coverage),
           pull);
    const MotionStiffness stiffness{.points = points_,
                                    .jacobians = now.jacobians,
                                    .rigidity = areas_.cwiseProduct(weights_),
                                    .viscosity = sequence_viscosity * options_.bending * areas_,
                                    .ridge = ridge * unit,
                                    .at_rest = true};
    const RowMatrix<double> change = solve_velocity(basis_, stiffness, pull, {}, part);
    coefficients += change;
    ++report.iterations;
  }

  auto moved = std::make_shared<RadialField>(basis_, coefficients);
  progress.report(0.9, "measuring the result");
  measure(*moved, points_, normals_, target, report);
  report.diagonal = mesh_target.diagonal;
  for (std::string& warning : warnings_on(report.distortion, std::nullopt, {}))
    report.warnings.push_back(std::move(warning));
  solution.field = field_of(std::move(moved));
  report.seconds = watch.seconds();
  progress.report(1.0, "done");
  coefficients_ = std::move(coefficients);
  return solution;
}

Points WrapSequence::state() const {
  const std::lock_guard lock(one_at_a_time_);
  return coefficients_;
}

void WrapSequence::set_state(PointsIn state) {
  const std::lock_guard lock(one_at_a_time_);
  require(state.rows() == coefficients_.rows(), "state", "it is of another sequence",
          "a state of this one is needed");
  coefficients_ = state;
}

std::shared_ptr<DeformationField> WrapSequence::field() const {
  const std::lock_guard lock(one_at_a_time_);
  return field_of(std::make_shared<RadialField>(basis_, coefficients_));
}

std::shared_ptr<DeformationField> WrapSequence::field_of(std::shared_ptr<const RadialField> motion) const {
  std::vector<FieldStep> steps = first_;
  steps.push_back({std::move(motion), 1});
  auto field = std::make_shared<ComposedField>(std::move(steps));
  field->set_frame(frame_);
  field->set_rest_points(kept_);
  return field;
}

}  // namespace arapfields
