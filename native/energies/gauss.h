// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/jets.h"
#include "options/stylize.h"

namespace arapfields {

/// A function g on the sphere of directions that is 1 at each preferred normal n_k and small far from all of
/// them: g(n) = Σ_k w_k exp(sharpness · n·n_k) (Kohlbrenner et al., "Gauss Stylization", 2021).
struct ARAPFIELDS_EXPORT GaussPreference {
  Points normals;                                 ///< (k,3), unit length
  Vector weights;                                 ///< (k)
  double sharpness = StylizeOptions().sharpness;  ///< σ
  double value(const Vec3& normal) const;
  /// (n) values at unit normals (n,3).
  Vector values(PointsIn directions) const;
};

/// Solves g(n_k) = 1 for the weights. Directions need not have unit length. Where the system is numerically
/// singular (many close normals) the smallest weights that still satisfy it are taken. Throws InvalidInput
/// for none, non-finite or zero normals, for a pair that coincides (named), and for sharpness outside (0,
/// 100].
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

}  // namespace arapfields
