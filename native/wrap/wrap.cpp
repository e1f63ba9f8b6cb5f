// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/wrap.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "core/stopwatch.h"
#include "distance/morton.h"
#include "sampling/sample_choice.h"
#include "solve/setup.h"
#include "solve/warnings.h"
#include "wrap/alignment.h"
#include "wrap/flow.h"

namespace arapfields {
namespace {

constexpr Index target_points = 12000, drawing_points = 6000, kept_rest_points = 4000,
                measured_points = 20000, energy_points = 4000;
/// From the first stage to the last: weights of the pull, of what resists and of distances whatever the
/// normals, share of ways along the target, and the radius and number of centers.
constexpr double first_pull = 10.0, last_pull = 2000.0, first_rigid = 1.0, last_rigid = 0.1,
                 last_nearest = 1.0, first_slack = 0.3, last_slack = 0.1, first_reach = 0.5,
                 last_reach = 0.067;
constexpr double first_centers = 60.0, landmark_pull = 30.0, viscosity = 1.5, coverage = 5.75;

double between(double first, double last, double t) { return first * std::pow(last / first, t); }

WrapStage stage_at(double t, const WrapOptions& options) {
  WrapStage stage;
  stage.pull = {between(first_pull, last_pull * options.closeness, t), coverage * options.coverage,
                options.normal_weight, between(first_slack, last_slack, t), last_nearest * t * t};
  stage.landmarks = landmark_pull * options.landmark_weight;
  stage.rigid = between(first_rigid, last_rigid, t);
  stage.viscous = viscosity * options.bending;
  stage.reach = between(first_reach, last_reach, t);
  const auto most = static_cast<double>(options.centers);
  stage.centers = static_cast<Index>(std::round(between(std::min(first_centers, most), most, t)));
  return stage;
}

/// The steps in the aligned cube as a field of the samples' own, which takes them onto the target.
std::shared_ptr<ComposedField> placed(std::vector<FieldStep> steps, const Similarity& placement,
                                      const SurfaceSamples& samples) {
  const Frame& frame = samples.frame;
  const RadialBasis none{Points(0, 3), Vector(0)};
  RowMatrix<double> there =
      none.identity() * (placement.scale / frame.scale * placement.rotation.transpose());
  there.row(0) += (placement.translation - frame.center).transpose() / frame.scale;
  steps.push_back({std::make_shared<RadialField>(none, std::move(there)), 1});
  auto field = std::make_shared<ComposedField>(std::move(steps));
  field->set_frame(frame);
  field->set_rest_points(samples.points.topRows(std::min(samples.size(), kept_rest_points)));
  return field;
}

/// Beside the scale of the alignment: `field` is of the aligned cube.
void measure(const ComposedField& field, const SurfaceSamples& samples, const WrapTarget& target,
             WrapReport& report) {
  Random random(0);
  const std::vector<Index> rows = stratified(morton_order(samples.points), measured_points, random);
  const Points points = rows_of(samples.points, rows);
  JetBlock<double> jets(points.rows(), JetOrder::first);
  field.evaluate(points, jets.view());
  report.distortion = distortion<double>(std::as_const(jets).view());
  const Points places = Eigen::Map<const Points>(jets.view().data, points.rows(), 3);
  RowMatrix<double> jacobians(points.rows(), 9);
  for (Index i = 0; i < points.rows(); ++i)
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) jacobians(i, 3 * l + k) = jets.view().at(first_column(k), i)[l];
  Vector growth;
  const Points normals = moved_normals(jacobians, rows_of(samples.normals, rows), growth);
  const SurfaceDistances to = surface_distances(target.tree, target.points, target.normals, target.spacing,
                                                places, normals, growth, target.whole);
  const OrientedPoints tree(places, normals);
  const SurfaceDistances from =
      surface_distances(tree, places, normals, mean_spacing(places), target.points, target.normals, {}, {});
  report.to_target_mean = to.mean / target.diagonal;
  report.to_target_95 = to.most_95 / target.diagonal;
  report.from_target_mean = from.mean / target.diagonal;
  report.from_target_95 = from.most_95 / target.diagonal;
  const Points some = rows_of(points, random_subset(points.rows(), energy_points, random));
  JetBlock<double> second(some.rows(), JetOrder::second);
  field.evaluate(some, second.view());
  report.arap = arap_energy<double>(std::as_const(second).view(), 1.0, 0.0, {});
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
  progress.report(0.2, "aligned");

  const WrapTarget drawing = target.thinned(drawing_points);
  WrapFlow flow(samples, drawing, source.landmarks, ends, seed);
  const Progress flowing = progress.part(0.2, 0.95);
  const double all = options.stages * options.iterations;
  for (int stage = 0; stage < options.stages; ++stage) {
    const double t = options.stages > 1 ? static_cast<double>(stage) / (options.stages - 1) : 1.0;
    for (int k = 0; k < options.iterations; ++k) {
      flow.step(stage_at(t, options), flowing.part(static_cast<double>(report.iterations) / all,
                                                   static_cast<double>(report.iterations + 1) / all));
      ++report.iterations;
      progress.preview([&](PointsIn points) { return placed(flow.steps(), placement, samples)->at(points); });
    }
  }
  progress.report(0.95, "measuring the result");
  solution.field = placed(flow.steps(), placement, samples);
  measure(ComposedField(flow.steps()), samples, target, report);
  report.diagonal = there.diagonal;
  report.scale = placement.scale / samples.frame.scale;
  report.matched_share = flow.matched_share();
  const Vector left = placement.scale * (flow.landmarks() - ends).rowwise().norm();
  report.landmarks.assign(left.data(), left.data() + left.size());
  for (std::string& note : warnings_on(report.distortion, std::nullopt))
    report.notes.push_back(std::move(note));
  report.seconds = watch.seconds();
  progress.report(1.0, "done");
  return solution;
}

}  // namespace arapfields
