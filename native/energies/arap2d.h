// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/jets2d.h"
#include "energies/arap.h"

namespace arapfields {

/// The rotation of the plane closest to J: the angle atan2(J21 − J12, J11 + J22); the identity where both are
/// 0.
ARAPFIELDS_EXPORT Mat2 closest_rotation2(const Mat2& jacobian);

/// The as-rigid-as-possible energy of a map of the plane. With R the rotation closest to J, t = tr(RᵀJ) the
/// sum of J's signed singular values, E the quarter turn and D_k = ∂_k J, the rotation's angle turns at ∂_k θ
/// = ⟨D_k, R E⟩ / t; stretch is ‖J − R‖²_F, bend is Σ_k t (∂_k θ)². These are the values of arap_energy for
/// the extrusion (x, y, z) → (f(x, y), z). t is clamped to at least 0.01 in the bend. Adds the cotangents of
/// weight·(stretch + bending·bend) to `cotangents` (its data may be null: values alone).
template <class Scalar>
ARAPFIELDS_EXPORT ArapValue arap_energy2(JetView2<const Scalar> jets, double bending, double weight,
                                         JetView2<Scalar> cotangents);

}  // namespace arapfields
