// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "energies/body.h"
#include "solve/radial/problem.h"
#include "solve/radial/secondary_motion.h"
#include "solve/radial/stiffness.h"

namespace arapfields {

/// Length of a time step, in seconds, for which the constants of secondary motion are chosen.
constexpr double usual_step = 1.0 / 96.0;

/// State of secondary motion: masses, velocity and acceleration of the surface, and its inertial terms.
class SurfaceDynamics {
 public:
  explicit SurfaceDynamics(const RadialProblem& problem) : problem_(problem) {}
  /// None, or strength 0: no mass. Throws InvalidInput for numbers out of range.
  void set(const std::optional<SecondaryMotion>& motion);
  const std::optional<SecondaryMotion>& motion() const { return motion_; }
  bool has_mass() const { return motion_ && motion_->options.strength > 0.0; }
  /// Total mass, in units of the surface's energy · seconds²/cube unit².
  double mass() const { return unit_mass * motion_->options.strength; }
  /// Relative masses of the energy samples.
  const Vector& masses();
  /// ½ mass · mean m ‖v‖² for velocities v (n,3) of the energy samples.
  double kinetic_energy(PointsIn velocities);
  /// The body (energies/body.h) with this inertia, whose energy samples would move to `goal` (n,3) without
  /// forces; none without a mass.
  std::optional<Body<double>> body(double inertia = 0.0, Points goal = Points(0, 3));
  /// Low-pass filter of velocities or accelerations (coefficients), for time steps of length h.
  RowMatrix<double> smooth(const RowMatrix<double>& x, const StiffnessTerms& stiffness, double h);
  /// Sets zero velocity and unknown acceleration, with the handles at these motions.
  void zero_velocity(std::vector<Mat4> handle_motions);
  Revision revision() const { return revision_; }
  /// Revision of the masses.
  Revision mass_revision() const { return mass_revision_; }

  RowMatrix<double> velocities;     ///< of the coefficients; empty: at rest
  RowMatrix<double> accelerations;  ///< of the coefficients, at the end of the last step; empty: unknown
  std::vector<Mat4> motions;        ///< of the handles at the end of the last step or solve; empty: unknown

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
