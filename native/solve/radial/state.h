// SPDX-License-Identifier: GPL-3.0-or-later
// The state of a RadialSolver. Each part owns its data; its revision changes with them.
#pragma once

#include <memory>

#include "fields/tracked_points.h"
#include "solve/contact/constraints.h"
#include "solve/radial/dynamics.h"
#include "solve/radial/handle_terms.h"
#include "solve/radial/objective.h"
#include "solve/radial/radial_solver.h"
#include "solve/radial/stiffness.h"
#include "solve/radial/style_terms.h"

namespace arapfields {

/// The current field.
struct RadialShape {
  RowMatrix<double> coefficients;
  Revision revision = 0;  ///< of the coefficients
  Revision jumps = 0;     ///< changes made outside of solves, which invalidate quasi-Newton history

  void jump() {
    ++revision;
    ++jumps;
  }
};

/// The objective in one precision, and its last measurements.
template <class Scalar>
struct RadialPrecision {
  Dependent<std::unique_ptr<RadialObjective<Scalar>>, 1> objective;
  Revision handles = 0;                    ///< of the handles set in the objective
  Revision contact = 0;                    ///< of the contact set in the objective
  Dependent<Eigen::VectorX<Scalar>, 4> u;  ///< measurements of the current shape
  int uses = 0;                            ///< solves that have updated them incrementally
};

/// The factored preconditioner: L⁻¹ for stiffness, handles, stance and inertia = L Lᵀ.
struct RadialPreconditioner {
  Dependent<TallMatrix<float>, 5> inverse_factor;
  double inertia = 0.0;
  Revision revision = 0;
};

/// Warm-start data from past solves.
struct SolveHistory {
  struct Start {
    RowMatrix<double> coefficients;
    VectorF u;  ///< measurements; empty: they were recomputed since, and rounding differs
  };
  Dependent<QuasiNewton, 7> optimizer;
  Dependent<Start, 4> start;  ///< where the last solve started
};

struct RadialState {
  RadialState(const SurfaceSamples& samples, const LiveOptions& options, const Progress& progress,
              std::shared_ptr<const RestShape> rest_shape, std::shared_ptr<const HandleBlend> blend);

  /// Factors the preconditioner for this inertia, if it or a part has changed.
  void precondition(double inertia);
  /// The terms of jets of the current parts, for the energy samples.
  JetTermList jet_terms(std::optional<Body<double>> body);
  /// What keeps the energy samples in place; a style, a mass, and contact go without.
  Locality locality();
  /// The objective of the current parts, without inertia.
  template <class Scalar>
  RadialObjective<Scalar>& objective(RadialPrecision<Scalar>& precision);
  template <class Scalar>
  const Eigen::VectorX<Scalar>& measurements(RadialPrecision<Scalar>& precision);
  /// Marks the coefficients as changed, with these measurements.
  template <class Scalar>
  void set_measurements(RadialPrecision<Scalar>& precision, Eigen::VectorX<Scalar> u) {
    ++shape.revision;
    precision.u.set(measured_revisions(), std::move(u));
  }
  template <class Scalar>
  QuasiNewtonReport descend(RadialPrecision<Scalar>& precision, const QuasiNewtonOptions& how,
                            const Progress& progress);
  /// Adds the change between the last two starts of a drag if it lowers the objective; returns the old start.
  SolveHistory::Start extrapolate();
  /// Fills the report, in this precision.
  template <class Scalar>
  void measure(RadialPrecision<Scalar>& precision);
  /// Discards warm-start data, so that the next solve depends on the coefficients alone.
  void invalidate_history();
  std::array<Revision, 4> start_revisions() const {
    return {problem.energy_revision, preconditioner.revision, shape.jumps, contact.has_planes()};
  }

  RadialProblem problem;
  HandleTerms handles;
  StyleTerms style;
  StiffnessTerms stiffness;
  SurfaceDynamics dynamics;
  ContactConstraints contact;
  Dependent<std::vector<Index>, 1> holders;   ///< the handle that holds each sample; −1: none
  Dependent<Vector, 2> locality_shares;       ///< of the energy samples (solve/held_parts.h)
  Dependent<Vector, 1> fine_sizes;            ///< of the fine regions at the energy samples; empty: none
  Dependent<Vector, 1> pin_widths;            ///< width of the shape at each point handle
  Dependent<std::vector<Index>, 1> mirrored;  ///< with symmetry, the sample nearest to each one's reflection
  struct Tried {
    Points targets;                  ///< of the handles
    RowMatrix<double> coefficients;  ///< the solution
  } tried;                           ///< ContactSolve's last solve without contact
  bool in_one_go = false;            ///< handles jump to their targets, unlike in a drag
  RadialHooks hooks;
  Revision hooks_revision = 0;
  RadialPreconditioner preconditioner;
  RadialShape shape;
  RadialPrecision<float> fast;    ///< for all solves
  RadialPrecision<double> exact;  ///< for tolerances below single precision
  SolveHistory history;
  TrackedPoints tracked;
  RadialReport report;
  enum class Unmeasured { nothing, fast, exact } unmeasured = Unmeasured::nothing;  ///< of the report

 private:
  TallMatrix<float> factor(double inertia);
  std::array<Revision, 4> measured_revisions() const {
    return {shape.revision, handles.revision(), preconditioner.revision, problem.energy_revision};
  }
};

}  // namespace arapfields
