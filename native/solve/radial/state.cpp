// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/state.h"

#include <algorithm>
#include <bit>

#include "energies/distortion.h"
#include "energies/shared_motion.h"
#include "sampling/sample_choice.h"
#include "solve/held_parts.h"
#include "solve/radial/part_way.h"
#include "solve/warnings.h"

namespace arapfields {
namespace {

/// Solves after which incrementally updated measurements are recomputed.
constexpr int most_uses = 16;
/// Relative error of the objective in single precision.
constexpr double single_error = 1e-6;

}  // namespace

bool goes_part_way(const RadialState& s) {
  return s.style.any() && s.style.request()->strength < 1.0 && !s.handles.any() && !s.dynamics.has_mass() &&
         !s.contact.any() && !s.hooks.adds_terms();
}

RowMatrix<double> shown_coefficients(const RadialState& s) {
  if (!goes_part_way(s)) return s.shape.coefficients;
  const RowMatrix<double> rest = s.problem.basis.identity();
  return rest + s.style.request()->strength * (s.shape.coefficients - rest);
}

RadialState::RadialState(const SurfaceSamples& samples, const LiveOptions& options, const Progress& progress,
                         std::shared_ptr<const RestShape> rest_shape,
                         std::shared_ptr<const HandleBlend> blend)
    : problem(samples, options, progress, std::move(rest_shape), std::move(blend)),
      handles(problem),
      style(problem),
      stiffness(problem),
      dynamics(problem),
      contact(problem) {
  shape.coefficients = problem.basis.identity();
}

void RadialState::precondition(double inertia) {
  preconditioner.inertia = inertia;
  preconditioner.inverse_factor.get(
      {stiffness.revision(), handles.revision(), style.stance_revision(handles.any()),
       inertia > 0.0 ? dynamics.mass_revision() : 0, std::bit_cast<Revision>(inertia)},
      [&] { return factor(inertia); });
}

/// Assembles the quadratic model of stiffness, handles, links, stance and inertia, and inverts its factor.
TallMatrix<float> RadialState::factor(double inertia) {
  ++preconditioner.revision;
  RowMatrix<double> values = handles.basis_values();
  Vector weights = problem.options.handle_weight * handles.pairs().weights;
  const auto add = [&](RowMatrix<double> rows, Vector shares) {
    if (problem.mirror) {
      const RowMatrix<double> other = problem.mirror->reflected_rows(rows);
      rows.conservativeResize(2 * other.rows(), Eigen::NoChange);
      rows.bottomRows(other.rows()) = other;
      shares = 0.5 * shares.replicate(2, 1).eval();
    }
    values.conservativeResize(values.rows() + rows.rows(), Eigen::NoChange);
    weights.conservativeResize(values.rows());
    values.bottomRows(rows.rows()) = rows;
    weights.tail(rows.rows()) = shares;
  };
  if (const RowMatrix<double>& rows = handles.links().rows(); rows.rows() > 0)
    add(rows, Vector::Ones(rows.rows()));
  if (const auto& stance = style.stance(handles.any())) {
    auto [rows, shares] = stance_rows(problem.basis, problem.energy_points, stance->stance);
    add(std::move(rows), stance->weight * shares);
  }
  if (inertia > 0.0)
    add(radial_rows(problem.basis, problem.energy_points, JetOrder::value),
        0.5 * inertia / static_cast<double>(problem.energy_points.rows()) * dynamics.masses());
  return TallMatrix<float>(inverse_factor(stiffness.matrix(), values, weights), true);
}

Locality RadialState::locality() {
  if (!handles.any() || style.any() || dynamics.has_mass() || contact.any()) return Locality::none();
  Locality result;
  result.options = problem.options.locality;
  if (!result.acts()) return result;
  result.motion =
      shared_motion(handles.bound(), problem.samples.size(), problem.mirror ? problem.mirror->axis : -1);
  result.shares = locality_shares.get({handles.revision(), problem.energy_revision}, [&] {
    const auto folded = [&](Points points) {
      if (problem.mirror)
        points.col(problem.mirror->axis) = points.col(problem.mirror->axis).cwiseAbs().eval();
      return points;
    };
    return arapfields::locality_shares(folded(problem.energy_points), problem.energy_samples, handles.bound(),
                                       folded(handles.pairs().sources),
                                       {problem.shape->sites, problem.shape->parts});
  });
  result.sizes = fine_sizes.get({problem.energy_revision}, [&] {
    Vector sizes(problem.shape->fine_regions.empty() ? 0 : problem.energy_points.rows());
    sizes.setOnes();
    for (const FineRegion& region : problem.shape->fine_regions)
      sizes.array() *=
          Eigen::pow(std::min(region.size, 1.0), region.shares_at(problem.energy_points).array());
    return sizes;
  });
  return result;
}

JetTermList RadialState::jet_terms(std::optional<Body<double>> body) {
  JetTermSettings settings;
  if (const auto& weighted = style.style()) {
    settings.style = weighted->style;
    settings.gauss =
        goes_part_way(*this) ? problem.options.gauss_weight * weighted->style.factor : weighted->weight;
  }
  if (const auto& weighted = style.stance(handles.any())) {
    settings.stance = weighted->stance;
    settings.keep_stance = weighted->weight;
  }
  settings.barrier =
      std::max(problem.options.surface.barrier, contact.has_planes() ? ContactParameters::fold_barrier : 0.0);
  settings.barrier_threshold = problem.options.surface.barrier_threshold;
  settings.locality = locality();
  settings.body = std::move(body);
  settings.external = hooks.energies;
  settings.external_weight = hooks.weight;
  settings.further = hooks.terms;
  JetTermList terms(settings);
  TermBatch batch{problem.energy_points, Points(0, 3), stiffness.weights(), stiffness.bending(), {}};
  if (problem.samples.normals.rows() > 0)
    batch.normals = rows_of(problem.samples.normals, problem.energy_samples);
  terms.set_batch(batch);
  return terms;
}

template <class Scalar>
RadialObjective<Scalar>& RadialState::objective(RadialPrecision<Scalar>& precision) {
  RadialObjective<Scalar>& result = *precision.objective.get({problem.energy_revision}, [&] {
    precision.handles = precision.contact = 0;
    return std::make_unique<RadialObjective<Scalar>>(problem);
  });
  if (precision.handles != handles.revision())
    result.set_handles(handles.pairs(), handles.basis_values(), handles.links());
  precision.handles = handles.revision();
  result.set_targets(handles.pairs().targets);
  result.set_preconditioner(preconditioner.inverse_factor.latest());
  result.set_stiffness(stiffness.bending(), stiffness.weights());
  result.set_terms(jet_terms(dynamics.body()));
  result.set_observer(hooks.observer);
  if (precision.contact != contact.found().revision) {
    Eigen::VectorX<Scalar> u = precision.u.take(measured_revisions());
    result.set_contact(contact.found());
    precision.contact = contact.found().revision;
    if (u.size() > 0) {
      result.measure_contact(shape.coefficients, u);
      precision.u.set(measured_revisions(), std::move(u));
    }
  }
  return result;
}
template RadialObjective<float>& RadialState::objective(RadialPrecision<float>&);
template RadialObjective<double>& RadialState::objective(RadialPrecision<double>&);

template <class Scalar>
const Eigen::VectorX<Scalar>& RadialState::measurements(RadialPrecision<Scalar>& precision) {
  return precision.u.get(measured_revisions(), [&] {
    Eigen::VectorX<Scalar> u;
    precision.objective.latest()->measure(shape.coefficients, u);
    return u;
  });
}
template const VectorF& RadialState::measurements(RadialPrecision<float>&);

SolveHistory::Start RadialState::extrapolate() {
  const SolveHistory::Start before = history.start.take(start_revisions());
  SolveHistory::Start now{shape.coefficients, measurements(fast)};
  if (before.coefficients.size() == 0) return now;
  const RadialObjective<float>& objective = *fast.objective.latest();
  VectorF further;
  if (const Index size = std::min(now.u.size(), before.u.size()); size > 0) {
    further = now.u;
    further.head(size) = 2.0f * now.u.head(size) - before.u.head(size);
    objective.measure_contact(2.0 * now.coefficients - before.coefficients, further);  // the set has changed
  } else {
    objective.measure(now.coefficients - before.coefficients, further);
    further += now.u;
  }
  const double value = objective.value(now.u, nullptr);
  if (objective.value(further, nullptr) < (1.0 - single_error) * value) {
    shape.coefficients += now.coefficients - before.coefficients;
    set_measurements(fast, std::move(further));
  }
  return now;
}

template <class Scalar>
QuasiNewtonReport RadialState::descend(RadialPrecision<Scalar>& precision, const QuasiNewtonOptions& how,
                                       const Progress& progress) {
  QuasiNewton& optimizer = history.optimizer.get(
      {problem.energy_revision, hooks_revision, style.revision(), preconditioner.revision,
       dynamics.revision(), shape.jumps, contact.found().revision},
      [] { return QuasiNewton(); });
  Eigen::VectorX<Scalar> u = precision.u.take(measured_revisions());
  ++shape.revision;  // before minimise(), which has changed the coefficients if it throws Cancelled
  const QuasiNewtonReport found =
      optimizer.minimise(*precision.objective.latest(), how, shape.coefficients, u, progress);
  if (++precision.uses >= most_uses)
    precision.uses = 0;
  else
    precision.u.set(measured_revisions(), std::move(u));
  report.iterations += found.iterations;
  report.evaluations += found.evaluations;
  report.converged = found.converged;
  report.value = found.value;
  return found;
}
template QuasiNewtonReport RadialState::descend(RadialPrecision<float>&, const QuasiNewtonOptions&,
                                                const Progress&);
template QuasiNewtonReport RadialState::descend(RadialPrecision<double>&, const QuasiNewtonOptions&,
                                                const Progress&);

template <class Scalar>
void RadialState::measure(RadialPrecision<Scalar>& precision) {
  const RadialObjective<Scalar>& measured = objective(precision);
  Eigen::VectorX<Scalar> u = measurements(precision);
  if (goes_part_way(*this)) measured.measure(shown_coefficients(*this), u);
  report.terms = measured.parts(u);
  measured.with_jets(u, [&](JetView<const Scalar> jets) {
    const Eigen::VectorX<Scalar> weights = stiffness.weights().template cast<Scalar>(),
                                 bending = stiffness.bending().template cast<Scalar>();
    report.arap = arap_energy<Scalar>(jets, 1.0, 1.0, {},
                                      {weights.size() > 0 ? weights.data() : nullptr, bending.data()});
    report.distortion = distortion<Scalar>(jets);
    report.preference.reset();
    if (const auto& weighted = style.style()) {
      const Points normals = rows_of(problem.samples.normals, problem.energy_samples);
      const StyleAtSamples& at = weighted->style;
      const double energy = style_energy<Scalar>(jets, normals.template cast<Scalar>(), at.preference,
                                                 at.targets.template cast<Scalar>(),
                                                 at.weights.template cast<Scalar>(), 0.0, {});
      report.preference = preference_of(at.preference, energy);
    }
  });
  report.warnings =
      warnings_on(report.distortion, far_target(handles.bound(), problem.surface()), handles.bound());
  for (std::string& note : notes_on(report.contact)) report.warnings.push_back(std::move(note));
  const Points values = measured.handle_values(u).template cast<double>();
  const HandleBatch<double>& pairs = handles.pairs();
  const Index own = handles.own_count();
  const Vector distance = (values - pairs.targets).topRows(own).rowwise().norm();
  const double scale = problem.frame().scale;
  report.handle_mean = scale * distance.dot(pairs.weights.head(own)) / pairs.weights.head(own).sum();
  report.handle_max = scale * distance.maxCoeff();
  unmeasured = Unmeasured::nothing;
}
template void RadialState::measure(RadialPrecision<float>&);
template void RadialState::measure(RadialPrecision<double>&);

void RadialState::invalidate_history() {
  shape.jump();
  fast.uses = exact.uses = 0;
}

}  // namespace arapfields
