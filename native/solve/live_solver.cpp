// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_solver.h"

#include "solve/live_state.h"

namespace arapfields {

LiveSolver::LiveSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                       const LiveOptions& options, const Progress& progress,
                       std::shared_ptr<const RestShape> shape, std::shared_ptr<const HandleBlend> blend)
    : state_(
          std::make_unique<State>(samples, handles, options, progress, std::move(shape), std::move(blend))) {}

LiveSolver::~LiveSolver() = default;
LiveSolver::LiveSolver(LiveSolver&&) noexcept = default;
LiveSolver& LiveSolver::operator=(LiveSolver&&) noexcept = default;

void LiveSolver::set_handles(const std::vector<Handle>& handles) { state_->set_handles(handles); }

void LiveSolver::set_style(const Style& style, double strength, double sharpness, const Vector& weights,
                           const Vec3& up) {
  state_->set_style(style, strength, sharpness, weights, up);
}

void LiveSolver::clear_style() { state_->clear_style(); }

void LiveSolver::set_hooks(const LiveHooks& hooks) { state_->set_hooks(hooks); }

void LiveSolver::set_weights(const Vector& weights, const Vector& bend_weights) {
  state_->set_weights(weights, bend_weights);
}

void LiveSolver::set_symmetry(SymmetryPlane symmetry, const Progress& progress) {
  if (symmetry != state_->options().symmetry) state_ = state_->with_symmetry(symmetry, progress);
}

void LiveSolver::set_targets(const std::vector<Handle>& moved) { state_->set_targets(moved); }

std::shared_ptr<RadialField> LiveSolver::solve(Index iterations, double tolerance, const Progress& progress) {
  return state_->solve(iterations, tolerance, progress);
}

Index LiveSolver::follow(Index iterations, double tolerance, const Progress& progress) {
  return state_->follow(iterations, tolerance, progress);
}

void LiveSolver::set_secondary_motion(const std::optional<SecondaryMotion>& motion) {
  state_->set_secondary_motion(motion);
}

std::shared_ptr<RadialField> LiveSolver::step(const std::vector<Handle>& moved, double seconds,
                                              const Progress& progress, const Mat4& coordinates) {
  return state_->step(moved, seconds, coordinates, progress);
}

MotionState LiveSolver::motion_state() const { return state_->motion_state(); }

void LiveSolver::set_motion_state(const MotionState& state) { state_->set_motion_state(state); }

void LiveSolver::reset() { state_->reset(); }

void LiveSolver::adopt(const DeformationField& field) { state_->adopt(field); }

Index LiveSolver::watch_folds(double barrier) { return state_->watch_folds(barrier); }

void LiveSolver::track(PointsIn points) { state_->track(points); }

PointsF LiveSolver::tracked() const { return state_->tracked(); }

std::shared_ptr<RadialField> LiveSolver::field() const { return state_->field(); }

const LiveReport& LiveSolver::report() const { return state_->report(); }

const std::vector<Handle>& LiveSolver::handles() const { return state_->handles(); }

}  // namespace arapfields
