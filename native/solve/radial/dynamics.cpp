// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/dynamics.h"

#include <bit>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Cut-off of the low-pass filter S below, for steps of `usual_step`: the ratio of mean ‖J‖² + λ‖D‖² to the
/// mean square at which S = ½, of waves shorter than parts are thick, where solves converge last. τ is
/// proportional to the square root of the step.
constexpr double smoothed = 3e3;

}  // namespace

void SurfaceDynamics::set(const std::optional<SecondaryMotion>& motion) {
  if (motion) {
    motion->options.validate();
    require(!problem_.blend, "secondary motion", "with exact handles", "it needs handles that pull");
    const Vector& m = motion->masses;
    const Index count = problem_.given_count();
    const std::string one = "one mass ≥ 0 for each of the " + std::to_string(count) + " samples";
    require(m.size() == 0 || m.size() == count, "masses", std::to_string(m.size()) + " numbers",
            one + ", or none, is needed");
    require(m.allFinite() && (m.size() == 0 || m.minCoeff() >= 0.0), "masses",
            "negative or non-finite numbers", one + ", or none, is needed");
    require(
        m.size() == 0 || entries_of(problem_.at_all("masses", m), problem_.energy_samples).maxCoeff() > 0.0,
        "masses", "zero everywhere",
        "something must have a mass; strength 0 takes the secondary motion away");
    const double length = motion->up.stableNorm();
    require(std::isfinite(length) && length > 0.0, "up", length == 0.0 ? "zero" : "NaN or infinite",
            "a finite direction of any positive length is allowed");
    require(!motion->ground || std::isfinite(*motion->ground), "ground", "NaN or infinite",
            "a finite height is needed");
  }
  const Vector before = motion_ ? motion_->masses : Vector();
  motion_ = motion;
  if (motion_) motion_->up.normalize();
  const Vector after = motion_ ? motion_->masses : Vector();
  ++revision_;
  if (after.size() != before.size() || after != before) ++mass_revision_;
}

const Vector& SurfaceDynamics::masses() {
  return masses_.get({problem_.energy_revision, mass_revision_}, [&]() -> Vector {
    const bool alike = !motion_ || motion_->masses.size() == 0;
    const Vector own = alike
                           ? Vector::Ones(problem_.energy_points.rows())
                           : entries_of(problem_.at_all("masses", motion_->masses), problem_.energy_samples);
    const Vector areas = problem_.energy_areas();
    return areas.size() > 0 ? Vector(own.cwiseProduct(areas)) : own;
  });
}

double SurfaceDynamics::kinetic_energy(PointsIn velocities_at_samples) {
  return 0.5 * mass() * masses().dot(velocities_at_samples.rowwise().squaredNorm()) /
         static_cast<double>(velocities_at_samples.rows());
}

std::optional<Body<double>> SurfaceDynamics::body(double inertia, Points goal) {
  if (!has_mass()) return std::nullopt;
  Body<double> body{masses(), problem_.energy_points, std::move(goal), inertia};
  body.gravity = -mass() * motion_->options.gravity / problem_.frame().scale * motion_->up;
  return body;
}

/// Applies the filter 1 − (1 − S)² with S = (G + τK)⁻¹ G; G is the Gram matrix of the values at the energy
/// samples, K the stiffness matrix. It also removes components that vanish at all samples.
RowMatrix<double> SurfaceDynamics::smooth(const RowMatrix<double>& x, const StiffnessTerms& stiffness,
                                          double h) {
  const std::array revisions{problem_.energy_revision, stiffness.revision(), std::bit_cast<Revision>(h)};
  const Smoothing& s = smoothing_.get(revisions, [&] {
    const RowMatrix<double> rows = radial_rows(problem_.basis, problem_.energy_points, JetOrder::value);
    const Vector share = Vector::Constant(rows.rows(), 1.0 / static_cast<double>(rows.rows()));
    const RowMatrix<double> weighted = share.cwiseSqrt().asDiagonal() * rows;
    Smoothing made;
    made.gram.resize(rows.cols(), rows.cols());
    lower_gram<double>(Transpose::yes, weighted, 0.0, made.gram);
    made.inverse_factor =
        inverse_factor(std::sqrt(h / usual_step) / smoothed * stiffness.matrix(), rows, share);
    return made;
  });
  const auto once = [&](const RowMatrix<double>& from) -> RowMatrix<double> {
    const RowMatrix<double> y = s.gram.selfadjointView<Eigen::Lower>() * from;
    const RowMatrix<double> z = s.inverse_factor.triangularView<Eigen::Lower>() * y;
    return s.inverse_factor.transpose().triangularView<Eigen::Upper>() * z;
  };
  const RowMatrix<double> first = once(x);
  return 2.0 * first - once(first);
}

void SurfaceDynamics::zero_velocity(std::vector<Mat4> handle_motions) {
  velocities.resize(0, 3);
  accelerations.resize(0, 3);
  motions = std::move(handle_motions);
}

}  // namespace arapfields
