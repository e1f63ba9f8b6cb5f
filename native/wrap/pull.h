// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "wrap/target.h"

namespace arapfields {

/// How a target draws a surface.
struct WrapPull {
  double weight = 1.0;    ///< of the mean squared distance
  double coverage = 1.0;  ///< of the distances from the target's side beside those from the surface's
  double turn = 0.3;      ///< what normals count in what belongs to what, beside cube units
  double slack = 0.1;     ///< share of ways along the target in the squared distances
  double nearest = 0.0;   ///< weight, beside those, of distances to the nearest places whatever their normals
};

/// Points of a surface at some time of a wrap.
struct WrapPlaces {
  Points places, normals;  ///< (n,3), the normals of length 1
  Vector shares;           ///< (n) of the surface, of which each point stands for one; their sum is 1
};

/// weight · (mean of squared distances from the places to what belongs to them on the target, and coverage ·
/// the same from the target): a quadratic form of each place's way.
struct WrapForces {
  RowMatrix<double> forms;     ///< (n,6): xx, yy, zz, xy, xz, yz of each place's form
  Points pulls;                ///< (n,3): the forms' parts on the ways that are asked for
  Vector agreements;           ///< (n) between 0, where nothing belongs to a place, and 1
  double matched_share = 1.0;  ///< of the surface, that something on the target belongs to

  WrapForces(const WrapTarget& target, const WrapPlaces& surface, const WrapPull& pull);

 private:
  void add(Index place, const Vec3& way, const Vec3& normal, double slack, double weight);
};

}  // namespace arapfields
