// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <vector>

#include "solve/contact/planes.h"
#include "solve/contact/points.h"
#include "solve/contact/self_contact.h"
#include "solve/contact/surface.h"

namespace arapfields {

/// The sides of each surface that contact points are on: their last positions outside it, and friction's
/// anchors. `outside` and `anchors` move with the surface.
struct ContactSides {
  /// Value of `clearance` for points inside an obstacle that crosses the surface: they are not pushed out.
  static constexpr double left_inside = -std::numeric_limits<double>::infinity();

  std::vector<Points> outside;             ///< last position of each point known to be outside
  std::vector<Points> anchors;             ///< anchors of friction
  RowMatrix<double> clearance;             ///< (points, surfaces) signed distance at `outside`
  std::vector<std::vector<bool>> crossed;  ///< samples at or beside an intersection; empty: none

  ContactSides() = default;
  /// For so many points and surfaces, of which start() is needed.
  ContactSides(Index points, std::size_t surfaces);
  /// Starts the tracking of a surface's sides at these places.
  void start(Index surface, const ContactSurface& obstacle, PointsIn places);
  /// Finds where the obstacle crosses the deforming surface; points inside it there are left_inside.
  void find_crossings(Index surface, const ContactSurface& obstacle, const ContactPoints& points,
                      const RefinedPoints& refined, PointsIn places);
  /// Obstacles with points that are left_inside.
  std::vector<Index> crossing_surfaces() const;
  bool crosses(Index surface, Index sample) const {
    const std::vector<bool>& samples = crossed[static_cast<std::size_t>(surface)];
    return !samples.empty() && samples[static_cast<std::size_t>(sample)];
  }
  /// Applies an obstacle's motion to its `outside` and `anchors`.
  void move_with(Index surface, const Mat4& motion);
  /// Appends points with copies of these rows.
  void add(const std::vector<Index>& like);
  /// Starts the points appended last at their own places, where their samples are `crossed`.
  void begin_beside_crossings(Index surface, const ContactSurface& obstacle,
                              const std::vector<Index>& samples, PointsIn places);
};

/// What contact remembers of each of its points, and which points these are: a solve is rolled back to it as
/// a whole.
struct ContactHistory {
  ContactPoints::Refined refined = ContactPoints::unrefined();
  Points places;  ///< (points,3) positions at the last search
  ContactSides sides;
  RowMatrix<double> pressures;  ///< (points, surfaces and the shape itself) multipliers
  SelfContact::Search itself;   ///< empty without self-contact
};

/// The contact state that a solve can be rolled back to, whatever has been refined since.
struct ContactSnapshot {
  ContactHistory history;
  double stiffness = 0.0;
};

}  // namespace arapfields
