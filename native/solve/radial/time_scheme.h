// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace arapfields {

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

}  // namespace arapfields
