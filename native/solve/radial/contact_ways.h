// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <vector>

#include "energies/contact.h"
#include "solve/radial/barrier_surface.h"
#include "solve/radial/contact_points.h"
#include "solve/radial/self_contact.h"

namespace arapfields {

/// The planes that places of a surface are kept beyond, until they are found anew.
struct ContactSet {
  std::vector<Index> rows;  ///< which of the places that are followed
  Points places;            ///< (n,3) theirs at rest
  Points embedded;          ///< (n,3) these, in the basis' embedding; empty without one
  std::vector<ContactPlane> planes;
  Revision revision = 0;                  ///< 0: no planes
  double stiffness = 0.0;                 ///< of energy a unit of area for a unit of squared depth, halved
  static constexpr double softest = 5e4;  ///< the stiffness at first
  static constexpr double deep = 5e-4;    ///< solves leave no place deeper beyond a margin, in cube units

  /// The share of the area that presses.
  double touching() const;
  /// Forces of each surface, (surfaces, 3), on what is at a place: nearer ones count more.
  Points forces_at(const Vec3& place, const double* now, Index surfaces) const;
  /// The planes become as stiff as their pressures ask for, by steps, or `more`: where depths do not fall.
  void harden(bool more);
};

/// The ways that places took, of each surface: `seen` and `anchors` go along with it.
struct ContactWays {
  /// Clearance of places that an obstacle crosses: they stay inside until they come out by themselves.
  static constexpr double left_inside = -std::numeric_limits<double>::infinity();

  std::vector<Points> seen;     ///< where places were last known outside
  std::vector<Points> anchors;  ///< where friction holds them
  RowMatrix<double> clear;      ///< (places, surfaces) no surface is nearer to where they were seen
  std::vector<std::vector<bool>> crossed;  ///< samples that surfaces cross at or beside; empty: none
  SelfContact::Ways own;

  /// Finds where the surface crosses that of the places: what is inside there stays.
  void cross(Index surface, const BarrierSurface& obstacle, const ContactPoints& points, PointsIn places);
  /// Surfaces that places stay inside of.
  std::vector<Index> crossing() const;
  bool crosses(Index surface, Index sample) const {
    const std::vector<bool>& samples = crossed[static_cast<std::size_t>(surface)];
    return !samples.empty() && samples[static_cast<std::size_t>(sample)];
  }
  /// The surface and all that belongs to it have moved.
  void carry(Index surface, const Mat4& motion);
  /// Adds places, which are where the others at these rows are.
  void add(const std::vector<Index>& like);
  /// Of those that were added last, the ones of samples that the surface crosses begin where they are.
  void begin_beside_crossings(Index surface, const BarrierSurface& obstacle,
                              const std::vector<Index>& samples, PointsIn places);
};

/// What a surface that presses goes on with.
struct ContactPressing {
  ContactWays ways;
  RowMatrix<double> pressures;
  double stiffness = 0.0;
};

}  // namespace arapfields
