// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/wrap.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "core/task.h"
#include "distance/morton.h"
#include "sampling/sample_choice.h"
#include "solve/setup.h"
#include "solve/warnings.h"
#include "wrap/alignment.h"
#include "wrap/flow.h"
#include "wrap/landmark_check.h"
#include "wrap/measure.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

/// The flow's steps and the alignment as one field of the samples' own cube.
std::shared_ptr<ComposedField> field_of(std::vector<FieldStep> steps, const Similarity& placement,
                                        const SurfaceSamples& samples) {
  const Frame& frame = samples.frame;
  const RadialBasis affine{Points(0, 3), Vector(0)};
  RowMatrix<double> coefficients =
      affine.identity() * (placement.scale / frame.scale * placement.rotation.transpose());
  coefficients.row(0) += (placement.translation - frame.center).transpose() / frame.scale;
  steps.push_back({std::make_shared<RadialField>(affine, std::move(coefficients)), 1});
  auto field = std::make_shared<ComposedField>(std::move(steps));
  field->set_frame(frame);
  field->set_rest_points(samples.points.topRows(std::min(samples.size(), kept_rest_points)));
  return field;
}

WrapSource source_of(const SurfaceSamples& samples, const std::vector<Landmark>& landmarks) {
  WrapSource source{samples.points, samples.normals, {}, {}, samples.frame};
  const Index count = static_cast<Index>(landmarks.size());
  source.landmarks.resize(count, 3);
  source.landmark_targets.resize(count, 3);
  for (Index i = 0; i < count; ++i) {
    source.landmarks.row(i) = landmarks[i].rest;
    source.landmark_targets.row(i) = landmarks[i].target;
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

  // Alignment as a whole.
  const WrapTarget mesh_target = wrap_target(function, target_samples, seed, progress.part(0.0, 0.1));
  check_landmarks(source, mesh_target);
  const LandmarkVerdict verdict =
      trusted_landmarks(samples, source, mesh_target, options, report.warnings, progress.part(0.1, 0.15));
  check_contradictions(source, mesh_target, verdict.kept);
  report.left_out = verdict.left_out;
  const Similarity placement =
      wrap_alignment(source.with_landmarks(verdict.kept), mesh_target, options.alignment,
                     options.normal_weight, report.warnings, progress.part(0.15, 0.2));
  WrapTarget target = mesh_target.transformed_back(placement);
  if (samples.mesh)
    target.curvature = curvature_of(function, target, placement, seed, progress.part(0.2, 0.22));
  const Points landmark_targets = placement.inverse_of(source.landmark_targets);
  progress.report(0.2, "aligned");

  // Stages of falling stiffness.
  const WrapTarget flow_target = target.subsample(flow_target_samples);
  WrapFlow flow(samples, flow_target, source.landmarks, landmark_targets,
                {verdict.kept, landmark_weight.first * options.landmark_weight,
                 landmark_weight.last / landmark_weight.first},
                seed, progress.part(0.22, 0.23));
  flow.run(options, progress.part(0.23, 0.95), [&] {
    ++report.iterations;
    progress.preview([&](PointsIn points) { return field_of(flow.steps(), placement, samples)->at(points); });
  });

  // Result and report.
  progress.report(0.95, "measuring the result");
  solution.field = field_of(flow.steps(), placement, samples);
  measure(ComposedField(flow.steps()), samples.points, samples.normals, target, report);
  report.diagonal = mesh_target.diagonal;
  report.scale = placement.scale / samples.frame.scale;
  report.matched_share = flow.matched_share();
  const Vector errors = placement.scale * (flow.landmarks() - landmark_targets).rowwise().norm();
  report.landmarks.assign(errors.data(), errors.data() + errors.size());
  for (std::string& warning : warnings_on(report.distortion, std::nullopt, {}))
    report.warnings.push_back(std::move(warning));
  report.seconds = watch.seconds();
  progress.report(1.0, "done");
  return solution;
}

}  // namespace arapfields
