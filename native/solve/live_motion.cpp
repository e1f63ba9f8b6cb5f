// SPDX-License-Identifier: GPL-3.0-or-later
// How a live solver's surface moves as a body: steps in time.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "solve/live_setup.h"
#include "solve/live_state.h"

namespace arapfields {
namespace {

/// Stiffness of the ground against the energy of the surface.
constexpr double ground_stiffness = 1000.0;
/// Both stages of a step are implicit Euler steps of this share of it: the two-stage singly diagonally
/// implicit Runge-Kutta method of second order, which is L-stable (Alexander, SIAM J. Numer. Anal. 14, 1977).
/// It needs no force but those at its own stages, and all that one step leaves to the next is a place and a
/// velocity.
constexpr double stage_share = 1.0 - 0.5 * std::numbers::sqrt2;
/// A stage ends where its next step is expected to gain less than this share of the kinetic energy, or this.
constexpr double motion_tolerance = 1e-4, motion_floor = 1e-10;

/// Share of a way that a stage's start keeps: what no sample sees of a velocity, which nothing else slows,
/// dies away.
constexpr double unseen_decay = 0.998;

/// Seconds of a frame, at least and at most.
constexpr double shortest_frame = 1e-5, longest_frame = 10.0;

/// How far a motion of the coordinates may be from a rigid one.
constexpr double rigid_error = 1e-6;

/// The nearest power of two: frames of much the same length share a factored preconditioner.
double rounded(double inertia) { return std::exp2(std::round(std::log2(inertia))); }

}  // namespace

void LiveSolver::State::set_secondary_motion(const std::optional<SecondaryMotion>& motion) {
  if (motion) {
    motion->options.validate();
    require(!blend_, "secondary motion", "with exact handles", "it needs handles that pull");
    const Vector& m = motion->masses;
    const std::string one = "one mass ≥ 0 for each of the " + std::to_string(surface_.rows()) + " samples";
    require(m.size() == 0 || m.size() == surface_.rows(), "masses", std::to_string(m.size()) + " numbers",
            one + ", or none, is needed");
    require(m.allFinite() && (m.size() == 0 || m.minCoeff() >= 0.0), "masses",
            "negative or non-finite numbers", one + ", or none, is needed");
    require(m.size() == 0 || entries_of(m, chosen_).maxCoeff() > 0.0, "masses", "zero everywhere",
            "something must have a mass; strength 0 takes the secondary motion away");
    const double length = motion->up.stableNorm();
    require(std::isfinite(length) && length > 0.0, "up", length == 0.0 ? "zero" : "NaN or infinite",
            "a finite direction of any positive length is allowed");
    require(!motion->ground || std::isfinite(*motion->ground), "ground", "NaN or infinite",
            "a finite height is needed");
  }
  body_.asked = motion;
  if (body_.asked) body_.asked->up.normalize();
  body_.masses = body_.asked && body_.asked->masses.size() > 0 ? entries_of(body_.asked->masses, chosen_)
                                                               : Vector(Vector::Ones(std::ssize(chosen_)));
  for_each_precision([&](auto& precision) { weigh(precision); });
  optimizer_.forget();
}

/// The body that the objective feels, of which no inertia is asked.
template <class Scalar>
void LiveSolver::State::weigh(Precision<Scalar>& precision, double inertia, PointsOf<Scalar> goal) {
  if (!body_.has_mass()) return precision.objective->set_body(std::nullopt);
  Body<Scalar> body{body_.masses.cast<Scalar>(), rows_of(surface_, chosen_).cast<Scalar>(), std::move(goal),
                    inertia};
  body.up = body_.asked->up;
  body.gravity = -body_.mass() * body_.asked->options.gravity / frame_.scale * body.up;
  if (body_.asked->ground) {
    const Points on_ground = (*body_.asked->ground * body.up).transpose();
    body.ground = frame_.to_cube(on_ground).row(0).dot(body.up);
    body.ground_stiffness = ground_stiffness;
  }
  precision.objective->set_body(std::move(body));
}
template void LiveSolver::State::weigh<float>(Precision<float>&, double, PointsF);
template void LiveSolver::State::weigh<double>(Precision<double>&, double, Points);

/// Factors the preconditioner for this inertia, where it is not already.
void LiveSolver::State::precondition(double inertia) {
  if (inverse_factor_.size() > 0 && body_.factored_inertia == inertia) return;
  body_.factored_inertia = inertia;
  factorise();
}

MotionState LiveSolver::State::motion_state() const {
  RowMatrix<double> velocities = body_.velocities;
  if (velocities.size() == 0) velocities.setZero(basis_.size(), 3);
  return {coefficients_, velocities, body_.motions};
}

void LiveSolver::State::set_motion_state(const MotionState& state) {
  const auto fits = [&](const RowMatrix<double>& c) {
    return c.rows() == basis_.size() && c.cols() == 3 && c.allFinite();
  };
  require(fits(state.coefficients) && fits(state.velocities), "state",
          "of another solver, or with NaN or infinity",
          "one that this solver, or one with the same samples and options, gave is needed");
  require(state.motions.empty() || std::ssize(state.motions) == bound_.count(), "state",
          "of " + std::to_string(state.motions.size()) + " handles",
          "the solver has " + std::to_string(bound_.count()));
  coefficients_ = state.coefficients;
  body_.velocities = state.velocities;
  body_.motions = state.motions;
  forget_past();
}

/// What follows depends on the coefficients alone.
void LiveSolver::State::forget_past() {
  for_each_precision([](auto& precision) { precision.u.resize(0), precision.uses = 0; });
  u_before_.resize(0);
  optimizer_.forget();
}

/// The body has come to rest where it is.
void LiveSolver::State::rest() {
  body_.velocities.resize(0, 3);
  body_.motions = motions_of(bound_);
}

/// Where the pairs pull at a share of the way from earlier motions of the handles to those at hand.
Points LiveSolver::State::pair_targets_between(const std::vector<Mat4>& before, double share) const {
  if (handles_.empty()) return pairs_.targets;
  Points own(static_cast<Index>(pair_rows_.size()) + held_.rows(), 3);
  own << targets_between(bound_, before, share, pair_rows_), held_;
  if (!mirror_) return own;
  Points both(2 * own.rows(), 3);
  both << own, mirror_->reflected(own);
  return both;
}

/// One implicit stage of length `a` from `from` with `velocity`: where it ends.
RowMatrix<double> LiveSolver::State::stage(const RowMatrix<double>& from, const RowMatrix<double>& velocity,
                                           double a, const Twist& carried, const Progress& progress) {
  const double drag = 2.0 * body_.asked->options.damping * a;
  RowMatrix<double> goal = from + a * velocity;
  if (drag > 0.0) goal = (goal + drag * (from + a * carried.of(from, basis_.center_count()))) / (1.0 + drag);
  if (mirror_) mirror_->symmetrise(goal);
  VectorF reached;
  fast_.objective->measure(goal, reached);
  weigh<float>(fast_, body_.mass() * (1.0 + drag) / (a * a), fast_.objective->sample_values(reached));
  if (fast_.u.size() == 0) fast_.objective->measure(coefficients_, fast_.u);
  if (fast_.objective->value(reached, nullptr) < fast_.objective->value(fast_.u, nullptr)) {
    coefficients_ = goal;
    fast_.u = std::move(reached);
  }
  descend(fast_, {options_.iterations, 0.0, motion_tolerance * report_.kinetic + motion_floor}, progress);
  return coefficients_;
}

std::shared_ptr<RadialField> LiveSolver::State::step(const std::vector<Handle>& moved, double seconds,
                                                     const Mat4& coordinates, const Progress& progress) {
  require(std::isfinite(seconds) && seconds >= shortest_frame && seconds <= longest_frame, "seconds",
          number_text(seconds),
          number_text(shortest_frame) + " to " + number_text(longest_frame) + " is allowed");
  if (!body_.has_mass()) {
    set_targets(moved);
    return solve(0, 0.0, progress);
  }
  const Stopwatch watch;
  const MotionState start = motion_state();
  const std::vector<Handle> handles = handles_;
  try {
    set_targets(moved);
    change_coordinates(coordinates);
    const ThreadScope threads(solve_threads());
    advance(seconds, progress);
  } catch (...) {
    set_targets(handles);
    set_motion_state(start);
    throw;
  }
  weigh(fast_);
  measure(fast_);
  is_measured_ = true;
  report_.value = fast_.objective->value(fast_.u, nullptr);
  report_.seconds = watch.seconds();
  return field();
}

/// The same body, and the same handles of the last step, in coordinates that have moved.
void LiveSolver::State::change_coordinates(const Mat4& motion) {
  const Mat3 turn = motion.topLeftCorner<3, 3>();
  require(motion.allFinite() && motion.row(3) == Eigen::RowVector4d(0, 0, 0, 1) && turn.determinant() > 0.0 &&
              (turn.transpose() * turn - Mat3::Identity()).norm() < rigid_error,
          "coordinates", "not a rigid motion", "a (4, 4) matrix that turns and moves alone is needed");
  if (motion == Mat4::Identity()) return;
  const Mat4 m = frame_.motion_to_cube(motion);
  coefficients_ *= m.topLeftCorner<3, 3>().transpose();
  coefficients_.row(basis_.center_count()) += m.topRightCorner<3, 1>().transpose();
  if (body_.velocities.size() > 0) body_.velocities *= m.topLeftCorner<3, 3>().transpose();
  for (Mat4& handle : body_.motions) handle = m * handle;
}

void LiveSolver::State::advance(double seconds, const Progress& progress) {
  const std::vector<Mat4> now = motions_of(bound_);
  const std::vector<Mat4> before = body_.motions.size() == now.size() ? body_.motions : now;
  const Twist carried = twist_between(pair_targets_between(before, 0.0), pair_targets_between(before, 1.0),
                                      pairs_.weights, seconds);
  const auto count = static_cast<Index>(std::ceil(seconds / body_.asked->options.longest_step - 1e-9));
  const Index steps = std::max<Index>(1, count);
  const double h = seconds / static_cast<double>(steps), a = stage_share * h;
  precondition(rounded(body_.mass() * (1.0 / a + 2.0 * body_.asked->options.damping) / a));
  forget_past();
  if (body_.velocities.size() == 0) body_.velocities.setZero(basis_.size(), 3);
  report_.iterations = report_.evaluations = 0;
  report_.kinetic = kinetic_energy();
  RowMatrix<double> acceleration;  // of the last stage
  const auto guess = [&](const RowMatrix<double>& from, const RowMatrix<double>& velocity) {
    if (acceleration.size() == 0) return;
    coefficients_ = from + unseen_decay * a * (velocity + a * acceleration);
    fast_.u.resize(0);
  };
  for (Index k = 0; k < steps; ++k) {
    const auto aim = [&](double share) {
      const Points targets =
          pair_targets_between(before, (static_cast<double>(k) + share) / static_cast<double>(steps));
      fast_.objective->set_targets(targets);
    };
    const auto part = [&](Index stage) {
      const auto at = [&](Index s) {
        return static_cast<double>(2 * k + s) / static_cast<double>(2 * steps);
      };
      return progress.part(at(stage), at(stage + 1));
    };
    const RowMatrix<double> q = coefficients_, v = body_.velocities;
    guess(q, v);
    aim(stage_share);
    const RowMatrix<double> first = (stage(q, v, a, carried, part(0)) - q) / a;
    acceleration = (first - v) / a;
    const RowMatrix<double> from = q + (h - a) * first, velocity = v + (h - a) * acceleration;
    guess(from, velocity);
    aim(1.0);
    body_.velocities = (stage(from, velocity, a, carried, part(1)) - from) / a;
    acceleration = (body_.velocities - velocity) / a;
  }
  report_.kinetic = kinetic_energy();
  for_each_precision([&](auto& precision) { precision.objective->set_targets(pairs_.targets); });
  body_.motions = now;
}

/// ½ mass · mean m ‖v‖² of the samples' velocities v; their root mean square becomes the report's speed.
double LiveSolver::State::kinetic_energy() {
  VectorF u;
  fast_.objective->measure(body_.velocities, u);
  const Points v = fast_.objective->sample_values(u).cast<double>();
  report_.speed = frame_.scale * std::sqrt(v.rowwise().squaredNorm().mean());
  return 0.5 * body_.mass() * body_.masses.dot(v.rowwise().squaredNorm()) / static_cast<double>(v.rows());
}

}  // namespace arapfields
