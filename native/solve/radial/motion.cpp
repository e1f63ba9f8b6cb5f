// SPDX-License-Identifier: GPL-3.0-or-later
// How a live solver's surface moves as a body: steps in time.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "core/dense.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "fields/radial_basis.h"
#include "sampling/sample_choice.h"
#include "solve/radial/state.h"
#include "solve/radial/stiffness.h"

namespace arapfields {
namespace {

/// Stiffness of the ground against the energy of the surface.
constexpr double ground_stiffness = 1000.0;
/// What swings too fast to be shown keeps so much a step: a jump of the handles soon stops ringing, and
/// slower swings lose nothing of note.
constexpr double kept_of_fast = 0.7;
constexpr TimeScheme usual = TimeScheme::generalised_alpha(kept_of_fast);

/// Seconds of a step for which the next three hold.
constexpr double usual_step = 1.0 / 96.0;
/// A step ends where its next one is expected to gain less than this share of the kinetic energy, as the
/// square of its length, at most the second; or this share of all, or this, which is what single precision
/// can tell.
constexpr double motion_share = 3e-4, largest_share = 1e-2, motion_tolerance = 3e-5, motion_floor = 1e-10;
/// Velocities and accelerations half of which a step takes, as the root of its length, by their mean
/// ‖J‖² + λ‖D‖² against their mean square: waves shorter than a part is thick, which solves see last.
constexpr double smoothed = 3e3;
/// The first step from rest may take so many times longer: its acceleration is not known.
constexpr Index first_iterations = 4;
/// What a solve may leave of a step's way, as a share.
constexpr double most_left = 0.1;

/// Seconds of a frame, at least and at most.
constexpr double shortest_frame = 1e-5, longest_frame = 10.0;

/// How far a motion of the coordinates may be from a rigid one.
constexpr double rigid_error = 1e-6;

/// The nearest power of two: frames of much the same length share a factored preconditioner.
double rounded(double inertia) { return std::exp2(std::round(std::log2(inertia))); }

}  // namespace

void RadialSolver::State::set_secondary_motion(const std::optional<SecondaryMotion>& motion) {
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
void RadialSolver::State::weigh(Precision<Scalar>& precision, double inertia, PointsOf<Scalar> goal) {
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
template void RadialSolver::State::weigh<float>(Precision<float>&, double, PointsF);
template void RadialSolver::State::weigh<double>(Precision<double>&, double, Points);

/// Factors the preconditioner for this inertia, where it is not already.
void RadialSolver::State::precondition(double inertia) {
  if (inverse_factor_.size() > 0 && body_.factored_inertia == inertia) return;
  body_.factored_inertia = inertia;
  factorise();
}

/// What smooth() needs after steps of length h.
void RadialSolver::State::choose_smoothing(double h) {
  if (body_.smoothing.size() > 0 && body_.smoothed == h) return;
  const RowMatrix<double> rows = radial_rows(basis_, rows_of(surface_, chosen_), JetOrder::value);
  const Vector share = Vector::Constant(rows.rows(), 1.0 / static_cast<double>(rows.rows()));
  const RowMatrix<double> weighted = share.cwiseSqrt().asDiagonal() * rows;
  body_.gram.resize(rows.cols(), rows.cols());
  lower_gram<double>(Transpose::yes, weighted, 0.0, body_.gram);
  body_.smoothing = inverse_factor(std::sqrt(h / usual_step) / smoothed * stiffness_, rows, share);
  body_.smoothed = h;
}

/// Velocities and accelerations without their short waves, and without what no sample sees of them:
/// 1 − (1 − S)² of S = (G + τK)⁻¹ G, for the mean squares of the values at the samples and of the
/// derivatives.
RowMatrix<double> RadialSolver::State::smooth(const RowMatrix<double>& velocities) const {
  const auto once = [&](const RowMatrix<double>& x) -> RowMatrix<double> {
    const RowMatrix<double> y = body_.gram.selfadjointView<Eigen::Lower>() * x;
    const RowMatrix<double> z = body_.smoothing.triangularView<Eigen::Lower>() * y;
    return body_.smoothing.transpose().triangularView<Eigen::Upper>() * z;
  };
  const RowMatrix<double> first = once(velocities);
  return 2.0 * first - once(first);
}

MotionState RadialSolver::State::motion_state() const {
  RowMatrix<double> velocities = body_.velocities;
  if (velocities.size() == 0) velocities.setZero(basis_.size(), 3);
  return {coefficients_, velocities, body_.accelerations, body_.motions};
}

void RadialSolver::State::set_motion_state(const MotionState& state) {
  const auto fits = [&](const RowMatrix<double>& c) {
    return c.rows() == basis_.size() && c.cols() == 3 && c.allFinite();
  };
  require(fits(state.coefficients) && fits(state.velocities) &&
              (state.accelerations.size() == 0 || fits(state.accelerations)),
          "state", "of another solver, or with NaN or infinity",
          "one that this solver, or one with the same samples and options, gave is needed");
  require(state.motions.empty() || std::ssize(state.motions) == bound_.count(), "state",
          "of " + std::to_string(state.motions.size()) + " handles",
          "the solver has " + std::to_string(bound_.count()));
  coefficients_ = state.coefficients;
  body_.velocities = state.velocities;
  body_.accelerations = state.accelerations;
  body_.motions = state.motions;
  forget_past();
}

/// What follows depends on the coefficients alone.
void RadialSolver::State::forget_past() {
  for_each_precision([](auto& precision) { precision.u.resize(0), precision.uses = 0; });
  u_before_.resize(0);
  optimizer_.forget();
}

/// The body has come to rest where it is.
void RadialSolver::State::rest() {
  body_.velocities.resize(0, 3);
  body_.accelerations.resize(0, 3);
  body_.motions = motions_of(bound_);
}

/// Where the pairs pull at a share of the way from earlier motions of the handles to those at hand.
Points RadialSolver::State::pair_targets_between(const std::vector<Mat4>& before, double share) const {
  if (handles_.empty()) return pairs_.targets;
  Points own(static_cast<Index>(pair_rows_.size()) + held_.rows(), 3);
  own << targets_between(bound_, before, share, pair_rows_), held_;
  if (!mirror_) return own;
  Points both(2 * own.rows(), 3);
  both << own, mirror_->reflected(own);
  return both;
}

/// One step of a scheme from the place, velocity and acceleration at hand. Whether it could be solved; a step
/// of backward Euler always moves, others only then.
bool RadialSolver::State::swing(const TimeScheme& scheme, double h, const Twist& carried,
                                const Progress& progress) {
  const auto [alpha, w, gamma, beta] = scheme;
  if (fast_.u.size() == 0) fast_.objective->measure(coefficients_, fast_.u);
  const RowMatrix<double> q = coefficients_, v = body_.velocities;
  RowMatrix<double> a = RowMatrix<double>::Zero(q.rows(), 3);
  if (scheme == usual) a = body_.accelerations;
  const VectorF u = fast_.u;
  const double drag = 2.0 * body_.asked->options.damping, unit = scheme.reach() * h * h;
  const double inert = scheme.inert(drag * h), inertia = body_.mass() * inert / unit;
  const RowMatrix<double> ahead = q + w * h * (v + (0.5 - beta) * h * a);  // where a' = 0 would lead
  RowMatrix<double> known = alpha * a;
  if (drag > 0.0)
    known += drag * (v + w * h * (1.0 - gamma) * a - carried.of(q + w * h * v, basis_.center_count()));
  weigh<float>(fast_, inertia, fast_.objective->sample_values_of(ahead - unit / inert * known));
  coefficients_ = ahead + unit * a;
  fast_.objective->measure(coefficients_, fast_.u);
  const double share = std::min(largest_share, motion_share * std::pow(h / usual_step, 2.0));
  descend(fast_,
          {(scheme == TimeScheme::midpoint() ? first_iterations : 1) * options_.iterations, motion_tolerance,
           share * report_.kinetic + motion_floor},
          progress);
  if (!report_.converged && scheme != TimeScheme::backward_euler()) {
    coefficients_ = q;
    fast_.u = u;
    return false;
  }
  if (fast_.u.size() == 0) fast_.objective->measure(coefficients_, fast_.u);
  const VectorF du = fast_.u - u;
  const double further = 1.0 + left_along(du, inertia);
  const RowMatrix<double> way = further * (coefficients_ - q), next = (q + way - ahead) / unit;
  coefficients_ = q + way / w;
  fast_.u = u + static_cast<float>(further / w) * du;
  RowMatrix<double> both(q.rows(), 6);
  both << v + h * ((1.0 - gamma) * a + gamma * next), next;
  both = smooth(both);
  body_.velocities = both.leftCols(3);
  body_.accelerations = both.rightCols(3);
  if (mirror_) mirror_->symmetrise(body_.velocities), mirror_->symmetrise(body_.accelerations);
  return true;
}

/// How much further a step should go along its way `du`, as a share of it, so that what the solve left of the
/// gradient does no work on it: that it ends early then neither feeds nor slows the motion.
double RadialSolver::State::left_along(const VectorF& du, double inertia) {
  VectorF cotangents;
  fast_.objective->value(fast_.u, &cotangents);
  const Points way = fast_.objective->sample_values(du).cast<double>();
  const double curvature =
      inertia * body_.masses.dot(way.rowwise().squaredNorm()) / static_cast<double>(way.rows());
  const double share = -cotangents.cast<double>().dot(du.cast<double>()) / curvature;
  return std::abs(share) < most_left ? share : 0.0;  // else it is no small correction
}

std::shared_ptr<RadialField> RadialSolver::State::step(const std::vector<Handle>& moved, double seconds,
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
void RadialSolver::State::change_coordinates(const Mat4& motion) {
  const Mat3 turn = motion.topLeftCorner<3, 3>();
  require(motion.allFinite() && motion.row(3) == Eigen::RowVector4d(0, 0, 0, 1) && turn.determinant() > 0.0 &&
              (turn.transpose() * turn - Mat3::Identity()).norm() < rigid_error,
          "coordinates", "not a rigid motion", "a (4, 4) matrix that turns and moves alone is needed");
  if (motion == Mat4::Identity()) return;
  const Mat4 m = frame_.motion_to_cube(motion);
  coefficients_ *= m.topLeftCorner<3, 3>().transpose();
  coefficients_.row(basis_.center_count()) += m.topRightCorner<3, 1>().transpose();
  if (body_.velocities.size() > 0) body_.velocities *= m.topLeftCorner<3, 3>().transpose();
  if (body_.accelerations.size() > 0) body_.accelerations *= m.topLeftCorner<3, 3>().transpose();
  for (Mat4& handle : body_.motions) handle = m * handle;
}

void RadialSolver::State::advance(double seconds, const Progress& progress) {
  const std::vector<Mat4> now = motions_of(bound_);
  const std::vector<Mat4> before = body_.motions.size() == now.size() ? body_.motions : now;
  const Twist carried = twist_between(pair_targets_between(before, 0.0), pair_targets_between(before, 1.0),
                                      pairs_.weights, seconds);
  const auto count = static_cast<Index>(std::ceil(seconds / body_.asked->options.longest_step - 1e-9));
  const Index steps = std::max<Index>(1, count);
  const double h = seconds / static_cast<double>(steps);
  precondition(
      rounded(body_.mass() * usual.inert(2.0 * body_.asked->options.damping * h) / (usual.reach() * h * h)));
  choose_smoothing(h);
  forget_past();
  if (body_.velocities.size() == 0) body_.velocities.setZero(basis_.size(), 3);
  report_.iterations = report_.evaluations = 0;
  report_.kinetic = kinetic_energy();
  for (Index k = 0; k < steps; ++k) {
    const auto share = [&](double within) {
      return (static_cast<double>(k) + within) / static_cast<double>(steps);
    };
    const auto swings = [&](const TimeScheme& scheme) {
      fast_.objective->set_targets(pair_targets_between(before, share(scheme.w)));
      return swing(scheme, h, carried, progress.part(share(0.0), share(1.0)));
    };
    if (!swings(body_.accelerations.size() > 0 ? usual : TimeScheme::midpoint()))
      swings(TimeScheme::backward_euler());
  }
  report_.kinetic = kinetic_energy();
  for_each_precision([&](auto& precision) { precision.objective->set_targets(pairs_.targets); });
  body_.motions = now;
}

/// ½ mass · mean m ‖v‖² of the samples' velocities v; their root mean square becomes the report's speed.
double RadialSolver::State::kinetic_energy() {
  VectorF u;
  fast_.objective->measure(body_.velocities, u);
  const Points v = fast_.objective->sample_values(u).cast<double>();
  report_.speed = frame_.scale * std::sqrt(v.rowwise().squaredNorm().mean());
  return 0.5 * body_.mass() * body_.masses.dot(v.rowwise().squaredNorm()) / static_cast<double>(v.rows());
}

}  // namespace arapfields
