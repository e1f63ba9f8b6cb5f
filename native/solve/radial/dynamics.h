// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "energies/body.h"
#include "solve/radial/problem.h"
#include "solve/radial/secondary_motion.h"
#include "solve/radial/stiffness.h"

namespace arapfields {

/// Seconds of the step for which the constants of motions are chosen.
constexpr double usual_step = 1.0 / 96.0;

/// The surface as a body with a mass: its velocity and acceleration, and the forces that it feels.
class SurfaceDynamics {
 public:
  explicit SurfaceDynamics(const RadialProblem& problem) : problem_(problem) {}
  /// None, or strength 0: no mass. Throws InvalidInput for numbers that cannot be.
  void set(const std::optional<SecondaryMotion>& motion);
  const std::optional<SecondaryMotion>& motion() const { return motion_; }
  bool has_mass() const { return motion_ && motion_->options.strength > 0.0; }
  /// Against the energy of the surface, in seconds²/cube unit².
  double mass() const { return unit_mass * motion_->options.strength; }
  /// Relative masses of the energy samples.
  const Vector& masses();
  /// ½ mass · mean m ‖v‖² for velocities v (n,3) of the energy samples.
  double kinetic_energy(PointsIn velocities);
  /// What the objective adds for a body with this inertia that would go to the goal (n,3) without forces.
  template <class Scalar>
  std::optional<Body<Scalar>> inertia_terms(double inertia = 0.0, PointsOf<Scalar> goal = {});
  /// Velocities or accelerations without their short waves, after steps of length h.
  RowMatrix<double> smooth(const RowMatrix<double>& x, const StiffnessTerms& stiffness, double h);
  /// The body is at rest where the handles have these motions.
  void zero_velocity(std::vector<Mat4> handle_motions);
  Revision revision() const { return revision_; }
  /// Of the masses.
  Revision mass_revision() const { return mass_revision_; }

  RowMatrix<double> velocities;     ///< of the coefficients; empty: at rest
  RowMatrix<double> accelerations;  ///< of the coefficients, by the last step's forces; empty: not known
  std::vector<Mat4> motions;        ///< of the handles where the last step or solve ended; empty: not known

 private:
  static constexpr double unit_mass = 1.0 / 300.0;
  struct Smoothing {
    RowMatrix<double> gram;
    RowMatrix<double> inverse_factor;
  };

  const RadialProblem& problem_;
  std::optional<SecondaryMotion> motion_;  // `up` of length 1
  Dependent<Vector, 2> masses_;
  Dependent<Smoothing, 3> smoothing_;
  Revision revision_ = 0;
  Revision mass_revision_ = 0;
};

}  // namespace arapfields
