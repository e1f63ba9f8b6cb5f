// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/dependent.h"
#include "core/jets.h"
#include "solve/contact/parameters.h"

namespace arapfields {

/// A linearised contact constraint on a point of the surface, or on a point relative to a second one
/// (self-contact): gap = normal·(f_first − f_second) − offset ≥ 0, with the normal fixed.
struct ContactPlane {
  Index first = 0;    ///< row of the places
  Index second = -1;  ///< −1: none, f_second = 0
  Vec3 normal;        ///< unit length, to the feasible side
  double offset = 0.0;
  double pressure = 0.0;       ///< Lagrange multiplier per unit of area, ≥ 0
  double area = 0.0;           ///< area weight: fraction of the surface's area
  Index obstacle = 0;          ///< index of the surface: an obstacle, a ground, or the shape itself
  double initial_gap = 0.0;    ///< the gap at the search that made the plane
  Vec3 anchor = Vec3::Zero();  ///< position of the point under static friction
  double friction = 0.0;       ///< coefficient times pressure; 0: frictionless

  /// Tangential displacement from the anchor.
  template <class Scalar>
  Vec3 slip(const Scalar* places) const {
    const Vec3 motion =
        Eigen::Map<const Eigen::Vector3<Scalar>>(places + 3 * first).template cast<double>() - anchor;
    return along(motion);
  }
  /// The tangential component of a vector.
  Vec3 along(const Vec3& vector) const { return vector - normal.dot(vector) * normal; }

  /// The gap at places (n,3), negative where the constraint is violated.
  template <class Scalar>
  double gap(const Scalar* places) const {
    double result = -offset;
    for (int k = 0; k < 3; ++k)
      result += normal[k] * (static_cast<double>(places[3 * first + k]) -
                             (second < 0 ? 0.0 : static_cast<double>(places[3 * second + k])));
    return result;
  }
  /// The updated multiplier max(0, pressure − stiffness·gap), which is also the contact force per area.
  double updated_pressure(double gap, double stiffness) const {
    return pressure > stiffness * gap ? pressure - stiffness * gap : 0.0;
  }
};

/// The contact planes (linearised contact constraints) of the last search, and the points that they act on.
struct ContactSet {
  std::vector<Index> rows;     ///< rows of ContactPoints, ascending; planes index these
  std::vector<Index> samples;  ///< the sample that each of these points is, or belongs to
  Points places;               ///< (n,3) rest positions of these points
  Points embedded;             ///< (n,3) the same in the basis' interior embedding; empty without one
  std::vector<ContactPlane> planes;
  Revision revision = 0;   ///< 0: no planes
  double stiffness = 0.0;  ///< augmented-Lagrangian: energy ½·stiffness·depth² a unit of area

  /// The fraction of the area in contact: where pressures are positive.
  double contact_area() const;
  /// Mean contact force of each surface, (surfaces, 3), near a place; the weights fall off with the distance.
  Points forces_at(const Vec3& place, const double* now, Index surfaces) const;
  /// Adapts the stiffness to the mean pressure; raises it if `raise`, else lowers it gradually.
  void adapt_stiffness(bool raise);
};

/// The augmented Lagrangian Σ area (max(0, pressure − stiffness·gap)² − pressure²)/(2 stiffness) of the
/// planes, and friction Σ area·friction·|slip|, smoothed below ContactParameters::stuck (Li et al. 2020,
/// Incremental potential contact), at places (n,3) of the surface; adds its cotangents (n,3) (null: the value
/// alone).
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double contact_energy(const std::vector<ContactPlane>& planes, double stiffness,
                                                 const Scalar* places, Scalar* cotangents);

/// First trial step length of a line search from places (n,3) along `displacements` (n,3), at most 1:
/// the minimiser of the planes' energy, whose second derivative jumps where a plane becomes active, plus a
/// quadratic model of all other terms. `slope` < 0 is the directional derivative of the total; the quadratic
/// is such that without changes of the active set the minimiser is 1. Returns 1 with friction.
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double contact_step(const std::vector<ContactPlane>& planes, double stiffness,
                                               const Scalar* places, const Scalar* displacements,
                                               double slope);

}  // namespace arapfields
