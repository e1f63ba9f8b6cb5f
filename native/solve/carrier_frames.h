// SPDX-License-Identifier: GPL-3.0-or-later
// Frames on a body's surface, and points that go along with several of them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/types.h"
#include "fields/field.h"

namespace arapfields {

/// Places spread evenly over a surface, whose motions frames are read off; the first few of them are spread
/// evenly as well.
class CarrierFrames {
 public:
  CarrierFrames() = default;
  /// From samples (n,3) of the surface.
  explicit CarrierFrames(PointsIn samples);
  const Points& places() const { return places_; }

 private:
  Points places_;
};

/// 0 up to `low`, 1 from `high`, with two derivatives that vanish at both.
double smooth_between(double low, double high, double x);

/// Points off a surface, each with the places that it goes along with. A place at the distance d has the
/// weight (1/d² − 1/c²)^1.5, c the distance of the first place that has none (a modified Shepard method, as
/// Franke and Little's): weights vanish where places come and go. Places are about as far apart as the
/// surface is away: denser ones for near points, few for far ones.
class CarriedPoints {
 public:
  CarriedPoints() = default;
  /// Points (n,3) with their distances (n, positive) to the surface of this size.
  CarriedPoints(const CarrierFrames& frames, PointsIn points, const Vector& distances, double size);
  Index size() const { return points_.rows(); }

  /// Where the points go with the motions of the places: ends (m,3) and rotations (3, m, 3: columns one after
  /// the other, as first derivatives of jets). Of the two ways to blend rigid motions, by places and by maps,
  /// one cuts corners where a surface bends and the other overshoots by as much: the mean of both.
  Points moved(const CarrierFrames& frames, PointsIn ends, const double* rotations) const;

 private:
  void choose(const CarrierFrames& frames, const Vector& distances, double size);

  Points points_;
  Points middles_;                      // (n,3) weighted means of the places
  std::vector<Index> start_;            // entries of point i: start_[i] … start_[i+1]−1
  std::vector<std::uint16_t> nearest_;  // places
  std::vector<float> weights_;          // of each entry; a point's sum to 1
};

}  // namespace arapfields
