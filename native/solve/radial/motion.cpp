// SPDX-License-Identifier: GPL-3.0-or-later
// Secondary motion: implicit time integration of a RadialSolver's surface.
#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/task.h"
#include "solve/contact/forces.h"
#include "solve/contact/handles.h"
#include "solve/radial/handle_motion.h"
#include "solve/radial/state.h"

namespace arapfields {
namespace {

/// One implicit step of length h from place q, velocity v and acceleration a to q', v', a':
///   q' = q + h v + h² ((½ − β) a + β a'), v' = v + h ((1 − γ) a + γ a'),
///   mass ((1 − α) a' + α a) = force at q + w (q' − q).
struct TimeScheme {
  double alpha;
  double w;
  double gamma;
  double beta;
  bool operator==(const TimeScheme&) const = default;

  /// The generalised-α method (Chung & Hulbert, J. Appl. Mech. 60, 1993) of second order. `kept` is the
  /// spectral radius at infinite frequency.
  static constexpr TimeScheme generalised_alpha(double kept) {
    const double alpha = (2.0 * kept - 1.0) / (kept + 1.0), w = 1.0 / (kept + 1.0);
    return {alpha, w, 0.5 - alpha + 1.0 - w, 0.25 * (2.0 - alpha - w) * (2.0 - alpha - w)};
  }
  /// The midpoint rule, of second order. It needs no acceleration at its start: a = 0.
  static constexpr TimeScheme midpoint() { return {0.0, 0.5, 1.0, 0.5}; }
  /// Of first order, with a = 0. It dissipates energy even if its system is solved roughly.
  static constexpr TimeScheme backward_euler() { return {0.0, 1.0, 1.0, 1.0}; }

  /// Factor of a' per unit of mass in the equation of motion; `drag` is the damping rate times h.
  constexpr double inert(double drag) const { return 1.0 - alpha + drag * w * gamma; }
  /// Factor of h² a' in the displacement to q + w (q' − q), where the force is evaluated.
  constexpr double reach() const { return w * beta; }
};

/// Spectral radius of the generalised-α method at infinite frequency: the factor on the amplitude a step. It
/// damps the ringing after a jump of the handles, and resolved oscillations hardly at all.
constexpr double kept_of_fast = 0.7;
constexpr TimeScheme usual = TimeScheme::generalised_alpha(kept_of_fast);

/// A solve ends when a further iteration would gain less than `motion_share` of the kinetic energy, for steps
/// of `usual_step`; the fraction grows with the square of the step, up to `largest_share`. The relative
/// tolerance and the absolute floor are what single precision resolves.
constexpr double motion_share = 3e-4, largest_share = 1e-2, motion_tolerance = 3e-5, motion_floor = 1e-10;
/// Factor on the iterations of the first step from rest, which has no initial acceleration to predict with.
constexpr Index first_iterations = 4;
/// Largest correction by remaining_step().
constexpr double most_left = 0.1;

/// Bounds of a frame's length, in seconds.
constexpr double shortest_frame = 1e-5, longest_frame = 10.0;

/// Tolerance of ‖RᵀR − I‖ for a change of coordinates.
constexpr double rigid_error = 1e-6;

/// The nearest power of two, so that frames of similar length share a factored preconditioner.
double rounded(double inertia) { return std::exp2(std::round(std::log2(inertia))); }

/// Integrates the surface of a solver over a frame, in time steps of equal length.
class TimeIntegrator {
 public:
  TimeIntegrator(RadialState& state, double seconds);
  void integrate(const Progress& progress);

 private:
  bool integrate_step(const TimeScheme& scheme, const Progress& progress);
  double remaining_step(const VectorF& du, double inertia) const;
  double kinetic_energy();

  RadialState& state_;
  SurfaceDynamics& body_;
  std::vector<Mat4> before_;  // motions of the handles at the start of the frame
  Index steps_;
  double h_;       // time step, seconds
  double drag_;    // viscous damping per mass, 1/second
  Twist carried_;  // the handles' mean rigid velocity; drag acts on velocities relative to it
};

TimeIntegrator::TimeIntegrator(RadialState& state, double seconds)
    : state_(state), body_(state.dynamics), before_(body_.motions) {
  const HandleTerms& handles = state.handles;
  if (std::ssize(before_) != handles.bound().count()) before_ = motions_of(handles.bound());
  const auto targets = [&](double share) {
    return handles.targets_at(motions_between(handles.bound(), before_, share));
  };
  carried_ = twist_between(targets(0.0), targets(1.0), handles.pairs().weights, seconds);
  const SecondaryMotionOptions& options = body_.motion()->options;
  steps_ = std::max<Index>(1, static_cast<Index>(std::ceil(seconds / options.longest_step - 1e-9)));
  h_ = seconds / static_cast<double>(steps_);
  drag_ = 2.0 * options.damping;
}

void TimeIntegrator::integrate(const Progress& progress) {
  state_.precondition(rounded(body_.mass() * usual.inert(drag_ * h_) / (usual.reach() * h_ * h_)));
  state_.objective(state_.fast);
  state_.invalidate_history();
  if (body_.velocities.size() == 0) body_.velocities.setZero(state_.problem.basis.size(), 3);
  state_.report.iterations = state_.report.evaluations = 0;
  state_.report.kinetic = kinetic_energy();
  for (Index k = 0; k < steps_; ++k) {
    const auto share = [&](double within) {
      return (static_cast<double>(k) + within) / static_cast<double>(steps_);
    };
    if (state_.contact.any()) {
      state_.contact.move_obstacles(share(1.0));
      state_.contact.find(state_.shape.coefficients, 2.0 * h_ * state_.contact.fastest(body_.velocities));
      state_.contact.add_friction();
    }
    const auto integrated = [&](const TimeScheme& scheme) {
      if (state_.contact.any()) state_.objective(state_.fast);
      set_reachable_targets(state_, motions_between(state_.handles.bound(), before_, share(scheme.w)),
                            Pull::full);
      return integrate_step(scheme, progress.part(share(0.0), share(1.0)));
    };
    const bool touches = state_.contact.found().contact_area() > 0.0;
    if (touches || !integrated(body_.accelerations.size() > 0 ? usual : TimeScheme::midpoint()))
      integrated(TimeScheme::backward_euler());
  }
  state_.report.kinetic = kinetic_energy();
  body_.motions = motions_of(state_.handles.bound());
}

/// One step of a scheme (Chung & Hulbert, J. Appl. Mech. 60, 1993, for the usual one). Returns whether the
/// solve converged; if not, only backward Euler moves the surface.
bool TimeIntegrator::integrate_step(const TimeScheme& scheme, const Progress& progress) {
  const auto [alpha, w, gamma, beta] = scheme;
  RadialObjective<float>& objective = *state_.fast.objective.latest();
  RowMatrix<double>& coefficients = state_.shape.coefficients;
  const VectorF u = state_.measurements(state_.fast);
  const RowMatrix<double> q = coefficients, v = body_.velocities;
  RowMatrix<double> a = RowMatrix<double>::Zero(q.rows(), 3);
  if (scheme == usual) a = body_.accelerations;
  // Predict: the position for a' = 0, and the explicit terms of the equation of motion.
  const double unit = scheme.reach() * h_ * h_;
  const double inert = scheme.inert(drag_ * h_), inertia = body_.mass() * inert / unit;
  const RowMatrix<double> ahead = q + w * h_ * (v + (0.5 - beta) * h_ * a);
  RowMatrix<double> known = alpha * a;
  if (drag_ > 0.0)
    known += drag_ * (v + w * h_ * (1.0 - gamma) * a -
                      carried_.of(q + w * h_ * v, state_.problem.basis.center_count()));
  const PointsF goal = objective.sample_values_of(ahead - unit / inert * known);
  objective.set_terms(state_.jet_terms(body_.body(inertia, goal.cast<double>())));
  stiffen_contact(state_);
  // Solve, starting from the prediction with the last acceleration.
  coefficients = ahead + unit * a;
  ++state_.shape.revision;
  const double share = std::min(largest_share, motion_share * std::pow(h_ / usual_step, 2.0));
  const Index tries = scheme == TimeScheme::midpoint() ? first_iterations : 1;
  state_.descend(state_.fast,
                 {tries * state_.problem.options.iterations, motion_tolerance,
                  share * state_.report.kinetic + motion_floor},
                 progress);
  for (Index round = 0; scheme == TimeScheme::backward_euler() && round < ContactParameters::motion_rounds;
       ++round) {
    const bool settled = update_pressures(state_) < ContactParameters::unsettled;
    if (settled && !is_deep(state_)) break;
    stiffen_contact(state_);
    state_.descend(
        state_.fast,
        {state_.problem.options.iterations, motion_tolerance, share * state_.report.kinetic + motion_floor},
        progress);
  }
  // A step with active contact, or not converged, is left to backward Euler, which dissipates energy.
  if (scheme != TimeScheme::backward_euler() && (would_press(state_) || !state_.report.converged)) {
    coefficients = q;
    state_.set_measurements(state_.fast, u);
    return false;
  }
  // Update position, velocity and acceleration.
  const VectorF du = state_.measurements(state_.fast) - u;
  const double further = 1.0 + remaining_step(du, inertia);
  const RowMatrix<double> step = further * (coefficients - q), next = (q + step - ahead) / unit;
  coefficients = q + step / w;
  state_.set_measurements<float>(state_.fast, u + static_cast<float>(further / w) * du);
  RowMatrix<double> both(q.rows(), 6);
  both << v + h_ * ((1.0 - gamma) * a + gamma * next), next;
  both = body_.smooth(both, state_.stiffness, h_);
  body_.velocities = both.leftCols(3);
  body_.accelerations = both.rightCols(3);
  if (const auto& mirror = state_.problem.mirror) {
    mirror->symmetrise(body_.velocities);
    mirror->symmetrise(body_.accelerations);
  }
  return true;
}

/// The relative change of a step `du` for which the remaining gradient does no work along it, so that a solve
/// that ends early neither adds nor dissipates energy; 0 if it is no small correction.
double TimeIntegrator::remaining_step(const VectorF& du, double inertia) const {
  const RadialObjective<float>& objective = *state_.fast.objective.latest();
  VectorF cotangents;
  objective.value(state_.measurements(state_.fast), &cotangents);
  const Points displacements = objective.sample_values(du).cast<double>();
  const double curvature = inertia * body_.masses().dot(displacements.rowwise().squaredNorm()) /
                           static_cast<double>(displacements.rows());
  const double share = -cotangents.cast<double>().dot(du.cast<double>()) / curvature;
  return std::abs(share) < most_left ? share : 0.0;
}

/// Sets the report's speed as well.
double TimeIntegrator::kinetic_energy() {
  const RadialObjective<float>& objective = *state_.fast.objective.latest();
  VectorF u;
  objective.measure(body_.velocities, u);
  const Points v = objective.sample_values(u).cast<double>();
  state_.report.speed = state_.problem.frame().scale * std::sqrt(v.rowwise().squaredNorm().mean());
  return body_.kinetic_energy(v);
}

/// Expresses the state of the last step in new coordinates, which a rigid motion (cube coordinates) leads to.
void change_coordinates(RadialState& s, const Mat4& motion) {
  const Mat3 turn = motion.topLeftCorner<3, 3>();
  require(motion.allFinite() && motion.row(3) == Eigen::RowVector4d(0, 0, 0, 1) && turn.determinant() > 0.0 &&
              (turn.transpose() * turn - Mat3::Identity()).norm() < rigid_error,
          "coordinates", "not a rigid motion", "a (4, 4) matrix that turns and moves alone is needed");
  if (motion == Mat4::Identity()) return;
  const Mat4 m = s.problem.frame().motion_to_cube(motion);
  const Mat3 transposed = m.topLeftCorner<3, 3>().transpose();
  s.shape.coefficients *= transposed;
  s.shape.coefficients.row(s.problem.basis.center_count()) += m.topRightCorner<3, 1>().transpose();
  s.shape.jump();
  for (RowMatrix<double>* rates : {&s.dynamics.velocities, &s.dynamics.accelerations})
    if (rates->size() > 0) *rates *= transposed;
  for (Mat4& handle : s.dynamics.motions) handle = m * handle;
  s.contact.change_coordinates(m);
}

}  // namespace

void RadialSolver::set_secondary_motion(const std::optional<SecondaryMotion>& motion,
                                        const Progress& progress) {
  RadialState& s = *state_;
  const ThreadScope threads(s.problem.options.threads);
  if (motion && motion->ground) s.contact.prepare(progress);
  s.dynamics.set(motion);
  std::optional<Ground> ground;
  if (s.dynamics.has_mass() && motion->ground) ground = Ground{*motion->ground, motion->up};
  s.contact.set_second_ground(ground, s.shape.coefficients);
}

MotionState RadialSolver::motion_state() const {
  const RadialState& s = *state_;
  RowMatrix<double> velocities = s.dynamics.velocities;
  if (velocities.size() == 0) velocities.setZero(s.problem.basis.size(), 3);
  return {s.shape.coefficients, velocities, s.dynamics.accelerations, s.dynamics.motions, s.contact.state()};
}

void RadialSolver::set_motion_state(const MotionState& state) {
  RadialState& s = *state_;
  const auto fits = [&](const RowMatrix<double>& c) {
    return c.rows() == s.problem.basis.size() && c.cols() == 3 && c.allFinite();
  };
  require(fits(state.coefficients) && fits(state.velocities) &&
              (state.accelerations.size() == 0 || fits(state.accelerations)),
          "state", "of another solver, or with NaN or infinity",
          "one that this solver, or one with the same samples and options, gave is needed");
  const Index count = s.handles.bound().count();
  require(state.motions.empty() || std::ssize(state.motions) == count, "state",
          "of " + std::to_string(state.motions.size()) + " handles",
          "the solver has " + std::to_string(count));
  s.contact.require_own(state.contact);
  s.shape.coefficients = state.coefficients;
  s.dynamics.velocities = state.velocities;
  s.dynamics.accelerations = state.accelerations;
  s.dynamics.motions = state.motions;
  s.contact.resume(state.contact, s.shape.coefficients);
  s.invalidate_history();
}

std::shared_ptr<RadialField> RadialSolver::step(const std::vector<Handle>& moved, double seconds,
                                                const Progress& progress, const Mat4& coordinates) {
  RadialState& s = *state_;
  require(std::isfinite(seconds) && seconds >= shortest_frame && seconds <= longest_frame, "seconds",
          number_text(seconds),
          number_text(shortest_frame) + " to " + number_text(longest_frame) + " is allowed");
  if (!s.dynamics.has_mass()) {
    set_targets(moved);
    return solve(0, 0.0, progress);
  }
  const Stopwatch watch;
  const MotionState start = motion_state();
  const std::vector<Handle> handles_before = handles();
  try {
    set_targets(moved);
    change_coordinates(s, coordinates);
    const ThreadScope threads(s.problem.solve_threads());
    if (s.contact.any()) s.contact.resume(s.contact.state(), s.shape.coefficients);
    TimeIntegrator(s, seconds).integrate(progress);
  } catch (...) {
    set_targets(handles_before);
    set_motion_state(start);
    throw;
  }
  s.report.contact.self_intersections.reset();
  s.measure(s.fast);
  s.report.value = s.fast.objective.latest()->value(s.measurements(s.fast), nullptr);
  s.report.seconds = watch.seconds();
  return field();
}

}  // namespace arapfields
