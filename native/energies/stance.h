// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"

namespace arapfields {

class JetTerm;

/// A figure's stance: its upward direction, and the samples on the ground.
struct ARAPFIELDS_EXPORT_TO_TESTS Stance {
  Vec3 up = Vec3::UnitZ();
  double scale = 1.0;  ///< one over its squared radius of gyration
  Vector ground;       ///< (n) weights of the samples on the ground, above 0 within 5 % of the height
  static constexpr double lean_weight = 20.0;  ///< of a rotation of the figure about a horizontal axis
  /// Regularisation of the inertia tensor, as a fraction of the squared size: it is singular for a line.
  static constexpr double thinnest = 1e-9;

  /// The stance of samples (n,3). Throws InvalidInput for a zero or non-finite direction.
  static Stance of(PointsIn points, const Vec3& upwards);
  /// The stance with the ground weights of these samples alone.
  Stance at(const std::vector<Index>& rows) const;
};

/// scale · (mean ‖d − d̄‖² + mean ground ((d − d̂)·up)² + lean_weight · mean ‖a‖² · ‖ω − (ω·up) up‖²) with
/// d = f(x) − x the displacements of samples x (n,3), d̄ their mean, d̂ their mean over the ground, a = x − x̄
/// and ω the infinitesimal rotation closest to d. The terms penalise displacements other than a translation,
/// unevenness of the ground, and leaning; the ARAP energy does not, since a rotating leg, or figure, is
/// rigid. Adds weight times its cotangents on the value column (data may be null).
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double stance_energy(JetView<const Scalar> jets, ConstPointsRef<Scalar> rest,
                                                const Stance& stance, double weight,
                                                JetView<Scalar> cotangents);

/// Where a translation of a figure without handles is measured: its lowest point, then some of its samples.
Points anchor_places(const Vec3& lowest, PointsIn samples);

/// The translation that gives the first of these places (n,3) its height along `up` back, and the others'
/// mean its place across it, from their values (n,3).
Vec3 anchoring_shift(PointsIn places, PointsIn values, const Vec3& up);

/// weight · stance_energy() of a batch of the samples; fresh ones are not on the ground.
std::shared_ptr<JetTerm> stance_term(Stance stance, double weight);

}  // namespace arapfields
