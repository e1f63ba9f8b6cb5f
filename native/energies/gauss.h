// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/jets.h"
#include "options/stylize.h"

namespace arapfields {

/// A function g on the sphere of directions that is 1 at each preferred normal n_k and small far from all of
/// them: g(n) = Σ_k w_k exp(sharpness · n·n_k) (Kohlbrenner et al., "Gauss Stylization", 2021).
struct ARAPFIELDS_EXPORT GaussPreference {
  Points normals;          ///< (k,3), unit length
  Vector weights;          ///< (k)
  double sharpness = 5.0;  ///< σ
  /// Whether σ follows from the normals; the style's weight and fall-off then do, too.
  bool automatic = false;
  /// Factor of the style's weight that makes up for the smaller rotations of styles with many faces: the mean
  /// angle from a direction to the cube's nearest normal over that to this style's, at least 1. 1 unless
  /// automatic.
  double balance = 1.0;
  double value(const Vec3& normal) const;
  /// (n) values at unit normals (n,3).
  Vector values(PointsIn directions) const;
  /// (n) falloff_at() for rest normals (n,3) and the nearest preferred normal: normals far from all preferred
  /// ones are left alone, or shapes would become paper-thin. All 1 unless automatic.
  Vector falloff(PointsIn directions) const;
};

/// Weight of a style for a normal at this cosine to its preferred direction: 1 up to 60°, 0 from 80° on.
double falloff_at(double cosine);

/// Rows (n,3) brought to unit length. Throws InvalidInput for none, non-finite or zero ones.
Points unit_normals(PointsIn normals);

/// Throws InvalidInput outside [0, 100].
void require_sharpness(double sharpness);

/// σ = 5 (1 − cos 45°) / (1 − cos θ/2), so that neighbours at the angle θ, the smallest of the style, overlap
/// midway as the cube's do at 5; from 5 to 25. Normals within 15° of each other belong to one curved face,
/// and count as one. Throws InvalidInput for none, non-finite or zero normals.
ARAPFIELDS_EXPORT double style_sharpness(PointsIn normals);

/// Solves g(n_k) = 1 for the weights. Directions need not have unit length. Where the system is numerically
/// singular (many close normals) the smallest weights that still satisfy it are taken. Sharpness 0 stands for
/// style_sharpness(). Throws InvalidInput for none, non-finite or zero normals, for a pair that coincides
/// (named), and for sharpness outside [0, 100].
ARAPFIELDS_EXPORT GaussPreference gauss_preference(PointsIn normals,
                                                   double sharpness = StylizeOptions().sharpness);

/// mean of u·(1 − g(ñ)) with ñ = J⁻ᵀn/‖J⁻ᵀn‖, for jets of at least first order at samples with unit rest
/// normals (n,3) and weights u (n; empty: all 1). Adds weight times its cotangents (data may be null). Near
/// rank-one Jacobians, whose minors are all below 1e-3, ñ shrinks instead of turning without bound.
template <class Scalar>
ARAPFIELDS_EXPORT double gauss_energy(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                                      const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights,
                                      const GaussPreference& preference, double weight,
                                      JetView<Scalar> cotangents);

/// mean of u·‖ñ − t‖² with unit targets t (n,3), one a sample; the rest as of gauss_energy.
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double target_energy(
    JetView<const Scalar> jets, ConstPointsRef<Scalar> normals, ConstPointsRef<Scalar> targets,
    const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
    JetView<Scalar> cotangents);

}  // namespace arapfields
