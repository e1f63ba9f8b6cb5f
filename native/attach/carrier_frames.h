// SPDX-License-Identifier: GPL-3.0-or-later
// Frames on a body's surface, and points that go along with several of them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/types.h"
#include "fields/field.h"

namespace arapfields {

/// Places on a surface whose motions frames are read off: 512, of which the first 192 and the first 64 are
/// spread evenly as well. Each of these levels divides the surface's area among its places.
class CarrierFrames {
 public:
  static constexpr std::array<Index, 3> levels = {512, 192, 64};

  CarrierFrames() = default;
  /// From samples (n,3) of the surface.
  explicit CarrierFrames(PointsIn samples);
  const Points& places() const { return places_; }
  /// Shares of the surface that the places of a level have; they sum to 1.
  const Vector& areas(std::size_t level) const { return areas_[level]; }

 private:
  Points places_;
  std::array<Vector, levels.size()> areas_;
};

/// 0 up to `low`, 1 from `high`, with two derivatives that vanish at both.
double smooth_between(double low, double high, double x);

/// Points off a surface, each with the places that it goes along with. The weights are those of an integral
/// over the surface of (1/d² − 1/c²)^1.5, d the distance to the point, c many times that of the nearest
/// place: nearly Poisson's kernel, so that motions spread between two limbs as evenly as a harmonic function
/// does. What is near is summed by the finest level of places, what is farther away by coarser ones.
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
  /// Means (n) of numbers of the places (m) over those close by alone.
  Vector means_close_by(const CarrierFrames& frames, const Vector& values) const;

 private:
  void choose(const CarrierFrames& frames);

  Points points_;
  Vector distances_;
  double size_ = 1.0;
  Points middles_;                     // (n,3) weighted means of the places
  std::vector<std::int64_t> start_;    // entries of point i: start_[i] … start_[i+1]−1
  std::vector<std::uint16_t> places_;  // of each entry
  std::vector<float> weights_;         // of each entry; a point's sum to 1
};

}  // namespace arapfields
