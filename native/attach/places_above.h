// SPDX-License-Identifier: GPL-3.0-or-later
// Places near a surface, which keep their distance from it as it grows.
#pragma once

#include "fields/field.h"
#include "mesh/surface_samples.h"

namespace arapfields {

/// Points near samples of a surface. A field says where a sample goes and how the surface turns and grows
/// there; a point goes where the samples about it say, on average. Where these contradict each other, as
/// between two limbs that approach, it goes with the field itself, unless that is far off.
class PlacesAbove {
 public:
  PlacesAbove() = default;
  /// Points (n,3) in the samples' cube, their distances (n) to the nearest sample, and the samples' spacing.
  PlacesAbove(const SurfaceSamples& samples, PointsIn points, const Vector& distances, double spacing);

  /// From where the field itself takes the points, (n,3) in mesh coordinates, to where they belong.
  void adjust(const DeformationField& field, Points& moved) const;

 private:
  Frame frame_;
  Points points_;     // those near the surface
  Points samples_;    // (m,3) those about them
  Points normals_;    // (m,3)
  Vector distances_;  // of each point to the nearest sample
  Vector reach_;      // and to the farthest that counts
  double spacing_ = 1.0;
};

}  // namespace arapfields
