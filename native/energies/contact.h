// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/jets.h"

namespace arapfields {

/// A place of the surface stays on one side of a plane, or of a plane that another place carries along:
/// normal·(f_first − f_second) ≥ offset.
struct ContactPlane {
  Index first = 0;    ///< row of the places
  Index second = -1;  ///< −1: none
  Vec3 normal;        ///< unit length
  double offset = 0.0;
  double pressure = 0.0;       ///< multiplier, ≥ 0
  double share = 0.0;          ///< of the surface's area
  Index obstacle = 0;          ///< which obstacle's it is
  double start = 0.0;          ///< the gap where it was found
  Vec3 anchor = Vec3::Zero();  ///< where the place would be if it stuck
  double grip = 0.0;           ///< friction that sliding meets, as `pressure`; 0: it slides freely

  /// From the anchor along the plane.
  template <class Scalar>
  Vec3 slip(const Scalar* places) const {
    const Vec3 way =
        Eigen::Map<const Eigen::Vector3<Scalar>>(places + 3 * first).template cast<double>() - anchor;
    return along(way);
  }
  /// The part of a way along the plane.
  Vec3 along(const Vec3& way) const { return way - normal.dot(way) * normal; }

  /// normal·(f_first − f_second) − offset at places (n,3).
  template <class Scalar>
  double gap(const Scalar* places) const {
    double result = -offset;
    for (int k = 0; k < 3; ++k)
      result += normal[k] * (static_cast<double>(places[3 * first + k]) -
                             (second < 0 ? 0.0 : static_cast<double>(places[3 * second + k])));
    return result;
  }
  /// The pressure after a solve that left this gap: what the plane presses with.
  double pressed(double gap, double stiffness) const {
    return pressure > stiffness * gap ? pressure - stiffness * gap : 0.0;
  }
};

/// Ways along a plane, in cube units, below which friction holds a place as a spring does.
constexpr double stuck = 2e-4;

/// The augmented Lagrangian Σ share (max(0, pressure − stiffness·gap)² − pressure²)/(2 stiffness) of the
/// planes, and friction Σ share·grip·|slip|, smooth below `stuck` (Li et al. 2020, Incremental potential
/// contact), at places (n,3) of the surface; adds its cotangents there (null: the value alone).
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double contact_energy(const std::vector<ContactPlane>& planes, double stiffness,
                                                 const Scalar* places, Scalar* cotangents);

/// How much of a step by `ways` (n,3), at most 1, to take from places (n,3): to the minimum along it of the
/// planes' energy, which has a kink where a plane is met, and of a quadratic for all else. `slope` < 0 is
/// that of both together, which a Newton step of 1 would end without kinks. 1 where friction acts.
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double contact_step(const std::vector<ContactPlane>& planes, double stiffness,
                                               const Scalar* places, const Scalar* ways, double slope);

}  // namespace arapfields
