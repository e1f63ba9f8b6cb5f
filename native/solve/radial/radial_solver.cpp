// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/radial_solver.h"

#include "solve/radial/state.h"

namespace arapfields {

RadialSolver::RadialSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                           const LiveOptions& options, const Progress& progress,
                           std::shared_ptr<const RestShape> shape, std::shared_ptr<const HandleBlend> blend)
    : state_(
          std::make_unique<State>(samples, handles, options, progress, std::move(shape), std::move(blend))) {}

RadialSolver::~RadialSolver() = default;
RadialSolver::RadialSolver(RadialSolver&&) noexcept = default;
RadialSolver& RadialSolver::operator=(RadialSolver&&) noexcept = default;

void RadialSolver::set_handles(const std::vector<Handle>& handles) { state_->set_handles(handles); }

void RadialSolver::set_style(const Style& style, double strength, double sharpness, const Vector& weights,
                             const Vec3& up) {
  state_->set_style(style, strength, sharpness, weights, up);
}

void RadialSolver::clear_style() { state_->clear_style(); }

void RadialSolver::set_hooks(const RadialHooks& hooks) { state_->set_hooks(hooks); }

void RadialSolver::set_weights(const Vector& weights, const Vector& bend_weights) {
  state_->set_weights(weights, bend_weights);
}

void RadialSolver::set_symmetry(SymmetryPlane symmetry, const Progress& progress) {
  if (symmetry != state_->options().symmetry) state_ = state_->with_symmetry(symmetry, progress);
}

void RadialSolver::set_targets(const std::vector<Handle>& moved) { state_->set_targets(moved); }

std::shared_ptr<RadialField> RadialSolver::solve(Index iterations, double tolerance,
                                                 const Progress& progress) {
  return state_->solve(iterations, tolerance, progress);
}

Index RadialSolver::follow(Index iterations, double tolerance, const Progress& progress) {
  return state_->follow(iterations, tolerance, progress);
}

void RadialSolver::set_secondary_motion(const std::optional<SecondaryMotion>& motion) {
  state_->set_secondary_motion(motion);
}

std::shared_ptr<RadialField> RadialSolver::step(const std::vector<Handle>& moved, double seconds,
                                                const Progress& progress, const Mat4& coordinates) {
  return state_->step(moved, seconds, coordinates, progress);
}

MotionState RadialSolver::motion_state() const { return state_->motion_state(); }

void RadialSolver::set_motion_state(const MotionState& state) { state_->set_motion_state(state); }

void RadialSolver::reset() { state_->reset(); }

void RadialSolver::adopt(const DeformationField& field) { state_->adopt(field); }

Index RadialSolver::watch_folds(double barrier) { return state_->watch_folds(barrier); }

void RadialSolver::track(PointsIn points) { state_->track(points); }

PointsF RadialSolver::tracked() const { return state_->tracked(); }

std::shared_ptr<RadialField> RadialSolver::field() const { return state_->field(); }

const RadialReport& RadialSolver::report() const { return state_->report(); }

const std::vector<Handle>& RadialSolver::handles() const { return state_->handles(); }

}  // namespace arapfields
