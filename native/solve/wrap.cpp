// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/wrap.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "core/stopwatch.h"
#include "fields/radial_evaluator.h"
#include "solve/live_setup.h"
#include "solve/notes.h"
#include "solve/setup.h"
#include "solve/wrap_alignment.h"
#include "solve/wrap_level.h"

namespace arapfields {
namespace {

/// Samples a center, at least, and the fewest centers.
constexpr Index samples_a_center = 8, least_centers = 50;
constexpr Index target_points = 12000, kept_rest_points = 4000;
/// From the first stage to the last: weights of the pull and of the landmarks, factor of the bending, and
/// share of ways along the target.
constexpr double first_pull = 5.0, last_pull = 5000.0, first_landmarks = 20.0, last_landmarks = 200.0,
                 first_bending = 1.0, last_bending = 0.02, first_slack = 0.5, last_slack = 0.05;

double between(double first, double last, double t) { return first * std::pow(last / first, t); }

WrapStage stage_at(double t, const WrapOptions& options) {
  WrapStage stage;
  stage.pull.weight = between(first_pull, last_pull * options.closeness, t);
  stage.pull.slack = between(first_slack, last_slack, t);
  stage.pull.coverage = options.coverage;
  stage.pull.turn = options.normal_weight;
  stage.landmarks = options.landmark_weight * between(first_landmarks, last_landmarks, t);
  stage.bending = between(first_bending, last_bending, t);
  return stage;
}

/// A field of the aligned cube as one of the samples' own, which takes them onto the target.
std::shared_ptr<RadialField> placed(const RadialBasis& basis, const RowMatrix<double>& coefficients,
                                    const Similarity& placement, const SurfaceSamples& samples) {
  const Frame& frame = samples.frame;
  RowMatrix<double> there = coefficients * (placement.scale / frame.scale * placement.rotation.transpose());
  there.row(basis.center_count()) += (placement.translation - frame.center).transpose() / frame.scale;
  auto field = std::make_shared<RadialField>(basis, std::move(there));
  field->set_frame(frame);
  field->set_rest_points(samples.points.topRows(std::min(samples.size(), kept_rest_points)));
  return field;
}

void measure_distances(const WrapPlaces& end, const WrapTarget& target, WrapReport& report) {
  const SurfaceDistances to = surface_distances(target.tree, target.points, target.normals, target.spacing,
                                                end.places, end.normals, end.growth, target.whole);
  const OrientedPoints tree(end.places, end.normals);
  const SurfaceDistances from = surface_distances(tree, end.places, end.normals, mean_spacing(end.places),
                                                  target.points, target.normals, {}, {});
  report.to_target_mean = to.mean / target.diagonal;
  report.to_target_95 = to.most_95 / target.diagonal;
  report.from_target_mean = from.mean / target.diagonal;
  report.from_target_95 = from.most_95 / target.diagonal;
}

/// Beside the scale of the alignment.
ArapValue measure_energy(const RadialBasis& basis, const RowMatrix<double>& coefficients, PointsIn samples) {
  Points some(std::min<Index>(samples.rows(), kept_rest_points), 3);
  for (Index i = 0; i < some.rows(); ++i) some.row(i) = samples.row(i * samples.rows() / some.rows());
  JetBlock<double> jets(some.rows(), JetOrder::second);
  RadialEvaluator<double>(basis, some).evaluate(coefficients, jets.view());
  return arap_energy<double>(std::as_const(jets).view(), 1.0, 0.0, {});
}

WrapSource source_of(const SurfaceSamples& samples, const std::vector<Landmark>& landmarks) {
  WrapSource source{samples.points, samples.normals, {}, {}, samples.frame};
  const Index count = static_cast<Index>(landmarks.size());
  source.landmarks.resize(count, 3);
  source.ends.resize(count, 3);
  for (Index i = 0; i < count; ++i) {
    source.landmarks.row(i) = landmarks[static_cast<std::size_t>(i)].rest;
    source.ends.row(i) = landmarks[static_cast<std::size_t>(i)].target;
  }
  source.landmarks = samples.frame.to_cube(source.landmarks);
  return source;
}

}  // namespace

WrapSolution wrap(const SurfaceSamples& samples, const ImplicitFunction& function,
                  const std::vector<Landmark>& landmarks, const WrapOptions& options,
                  const Progress& progress) {
  options.validate();
  require_samples(samples);
  require(samples.normals.rows() == samples.size(), "samples", "they have no normals",
          "wrap needs one a sample");
  const Stopwatch watch;
  const ThreadScope threads(options.threads);
  const auto seed = static_cast<std::uint64_t>(options.seed);
  WrapSolution solution;
  WrapReport& report = solution.report;
  const WrapSource source = source_of(samples, landmarks);
  const WrapTarget there = wrap_target(function, target_points, seed, progress.part(0.0, 0.1));
  check_landmarks(source, there);
  const Similarity placement = wrap_alignment(source, there, options.alignment, options.normal_weight,
                                              report.notes, progress.part(0.1, 0.15));
  const WrapTarget target = there.seen_from(placement);
  const Points ends = placement.inverse_of(source.ends);
  const RestShape shape(samples, true, seed);
  progress.report(0.2, "surface measured");

  const Index centers =
      std::min<Index>(options.centers, std::max(least_centers, samples.size() / samples_a_center));
  WrapLevel level(samples, shape, target, source.landmarks, ends, options, centers);
  RowMatrix<double> coefficients = level.basis().identity();
  double done = 0.2;
  for (int stage = 0; stage < options.stages; ++stage) {
    const double t = options.stages > 1 ? static_cast<double>(stage) / (options.stages - 1) : 1.0;
    const double next = done + (0.95 - done) / (options.stages - stage);
    report.iterations += level.descend(stage_at(t, options), coefficients, progress.part(done, next));
    done = next;
    progress.look(
        [&](PointsIn points) { return placed(level.basis(), coefficients, placement, samples)->at(points); });
  }
  progress.report(0.95, "measuring the result");
  solution.field = placed(level.basis(), coefficients, placement, samples);
  // Neighbours beside each other: blocks of points then see few centers.
  const std::vector<Index> order(shape.order.begin(), shape.order.end());
  const Points points = rows_of(samples.points, order);
  const RadialEvaluator<double> everywhere(level.basis(), points, JetOrder::first);
  const WrapPlaces end(everywhere, coefficients, rows_of(samples.normals, order));
  report.distortion = end.distortion;
  report.arap = measure_energy(level.basis(), coefficients, points);
  report.diagonal = there.diagonal;
  report.scale = placement.scale / samples.frame.scale;
  report.matched_share = level.matched_share();
  measure_distances(end, target, report);
  if (!landmarks.empty()) {
    Points reached(ends.rows(), 3);
    RadialEvaluator<double>(level.basis(), source.landmarks, JetOrder::value)
        .evaluate(coefficients, {reached.data(), ends.rows(), JetOrder::value});
    const Vector left = placement.scale * (reached - ends).rowwise().norm();
    report.landmarks.assign(left.data(), left.data() + left.size());
  }
  for (std::string& note : notes_on(report.distortion, std::nullopt)) report.notes.push_back(std::move(note));
  report.seconds = watch.seconds();
  progress.report(1.0, "done");
  return solution;
}

}  // namespace arapfields
