// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/report.h"

#include <algorithm>
#include <cmath>

#include "solve/field_measures.h"
#include "solve/setup.h"
#include "solve/warnings.h"

namespace arapfields {
namespace {

constexpr Index chunk = 1024;
constexpr Index kept_rest_points = 4000;

void merge(Distortion& total, const Distortion& part) {
  total.min_determinant = std::min(total.min_determinant, part.min_determinant);
  total.max_stretch = std::max(total.max_stretch, part.max_stretch);
  total.min_stretch = std::min(total.min_stretch, part.min_stretch);
}

void measure_handles(const DeformationField& field, const BoundHandles& handles, double scale,
                     SolveReport& report) {
  for (Index i = 0; i < handles.count(); ++i) {
    const Index begin = handles.begin(i), rows = handles.begin(i + 1) - begin;
    Points values(rows, 3);
    field.evaluate(handles.sources().middleRows(begin, rows), {values.data(), rows, JetOrder::value});
    const Vector distance = (values - handles.targets().middleRows(begin, rows)).rowwise().norm();
    report.handle_mean.push_back(distance.mean() * scale);
    report.handle_max.push_back(distance.maxCoeff() * scale);
  }
}

}  // namespace

SolveReport measure(const DeformationField& field, const SurfaceSamples& samples, const ObjectiveTerms& terms,
                    Index max_samples) {
  const Index count = std::min(samples.size(), max_samples);
  const bool styled = terms.style.any();
  Points points(count, 3), normals(styled ? count : 0, 3);
  Points targets(terms.style.targets.rows() > 0 ? count : 0, 3);
  Vector weights(terms.weights.size() > 0 ? count : 0);
  Vector bend_weights = Vector::Ones(count);
  for (Index i = 0; i < count; ++i) {
    const Index pick = i * samples.size() / count;
    points.row(i) = samples.points.row(pick);
    if (weights.size() > 0) weights[i] = terms.weights[pick];
    if (samples.bend_weights.size() > 0) bend_weights[i] = samples.bend_weights[pick];
    if (styled) normals.row(i) = samples.normals.row(pick);
    if (targets.rows() > 0) targets.row(i) = terms.style.targets.row(pick);
  }
  SolveReport report;
  double preference = 0.0;
  bool first = true;
  for (Index begin = 0; begin < count; begin += chunk) {
    const Index rows = std::min(chunk, count - begin);
    const double share = static_cast<double>(rows) / static_cast<double>(count);
    JetBlock<double> block(rows, JetOrder::second);
    field.evaluate(points.middleRows(begin, rows), block.view());
    const JetView<const double> jets = block.view();
    const Vector bending = terms.stiffness.bending(points.middleRows(begin, rows))
                               .cwiseProduct(bend_weights.segment(begin, rows));
    const ArapValue arap = arap_energy<double>(
        jets, 1.0, 0.0, {}, {weights.size() > 0 ? weights.data() + begin : nullptr, bending.data()});
    report.arap.stretch_energy += share * arap.stretch_energy;
    report.arap.stretch += share * arap.stretch;
    report.arap.bend += share * arap.bend;
    report.arap.energy += share * arap.energy;
    Distortion part = distortion<double>(jets);
    part.flipped_share = report.distortion.flipped_share + share * part.flipped_share;
    if (!first) merge(part, report.distortion);
    report.distortion = part;
    first = false;
    if (styled) {
      const Points rest = normals.middleRows(begin, rows);
      const Points target_normals =
          targets.middleRows(targets.rows() > 0 ? begin : 0, targets.rows() > 0 ? rows : 0);
      const auto& by = terms.style.preference;
      preference +=
          share * preference_of(by, style_energy<double>(jets, rest, by, target_normals, Vector(), 0.0, {}));
    }
  }
  if (styled) report.preference = preference;
  measure_handles(field, terms.handles, samples.frame.scale, report);
  return report;
}

FieldMeasures measure_at(const DeformationField& field, PointsIn points) {
  SurfaceSamples samples;
  samples.frame = field.frame();
  samples.points = samples.frame.to_cube(points);
  require_samples(samples);
  const SolveReport report = measure(field, samples, ObjectiveTerms(), samples.size());
  return {report.arap, report.distortion};
}

Solution measured(std::shared_ptr<DeformationField> field, const SurfaceSamples& samples,
                  const ObjectiveTerms& terms, LoopResult loop, Measures known) {
  Solution solution{std::move(field), {}};
  solution.report =
      known.at_samples ? *std::move(known.at_samples) : measure(*solution.field, samples, terms);
  const std::optional<FarTarget> far = far_target(terms.handles, samples.points);
  if (far) solution.report.far_target = far->sizes;
  std::optional<MeshMeasures> of_mesh = std::move(known.of_mesh);
  if (!of_mesh && samples.mesh) of_mesh = measure_triangles(*solution.field, *samples.mesh);
  if (of_mesh) {
    merge(solution.report.distortion, of_mesh->distortion);
    solution.report.turned_triangles = of_mesh->has_long_triangles() ? of_mesh->turned : 0;
  }
  solution.report.warnings = warnings_on(solution.report.distortion, far, terms.handles);
  if (of_mesh)
    for (std::string& warning : warnings_on(*of_mesh)) solution.report.warnings.push_back(std::move(warning));
  solution.report.loop = std::move(loop);
  return solution;
}

Solution solve_field(std::shared_ptr<TrainableField> field, const SurfaceSamples& samples,
                     ObjectiveTerms terms, const LoopOptions& options, const Progress& progress,
                     const WrapObjective& wrap) {
  field->set_frame(samples.frame);
  field->set_rest_points(samples.points.topRows(std::min(samples.size(), kept_rest_points)));
  if (options.steps > 1) {  // many steps with smaller batches converge faster than fewer with full ones
    terms.batch = (2 * terms.batch + 2) / 3;
    terms.fresh = (2 * terms.fresh + 2) / 3;
    terms.pull.handle_batch = (terms.pull.handle_batch + 3) / 4;
  }
  FieldObjective objective(samples, std::move(terms));
  const std::unique_ptr<Objective> wrapped = wrap ? wrap(objective) : nullptr;
  try {
    const LoopObserver shown = [&](int) {
      progress.preview([&](PointsIn points) { return field->at(points); });
    };
    LoopResult loop =
        minimise(*field, wrapped ? *wrapped : objective, options, progress.part(0.0, 0.95), shown);
    progress.report(0.95, "measuring the result");
    Solution solution = measured(field, samples, objective.objective_terms(), std::move(loop));
    solution.report.terms = (wrapped ? *wrapped : objective).terms();
    progress.report(1.0, "done");
    return solution;
  } catch (const LoopDiverged& cause) {
    throw SolveDiverged(cause, measured(field, samples, objective.objective_terms(), cause.result));
  }
}

}  // namespace arapfields
