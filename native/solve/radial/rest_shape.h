// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/one_at_a_time.h"
#include "fields/radial_basis.h"
#include "mesh/surface_samples.h"
#include "options/choices.h"
#include "sampling/local_thickness.h"
#include "sampling/parts.h"
#include "solve/radial/followed_places.h"

namespace arapfields {

/// What a surface's samples tell solvers before any handle: found once, and shared by all that solve on them.
/// In the samples' cube.
struct RestShape {
  /// `interior`: whether ways through the interior are looked for; `axis`: 0, 1 or 2 where fields are to be
  /// symmetric across the plane on which that coordinate is 0. Throws InvalidInput for no samples and for NaN
  /// or infinity among them, Cancelled. `may_join` is of samples, as interior_embedding() has it.
  RestShape(const SurfaceSamples& samples, bool interior, std::uint64_t seed, const Progress& progress,
            int axis = -1, const MayJoin& may_join = {});

  /// What contact follows of these samples, chosen when it is first asked for. Throws Cancelled.
  std::shared_ptr<const FollowedPlaces> followed(const SurfaceSamples& samples,
                                                 const Progress& progress) const;

  std::vector<std::uint32_t> order;  ///< the samples, neighbours beside each other
  std::shared_ptr<const LocalThickness> thickness;
  Points sites;              ///< (n,3) samples that centers are chosen from; folded where there is an axis
  RadialLayout layout;       ///< how dense centers stand there, and what is below
  std::vector<Index> parts;  ///< parts_of() the sites
  std::shared_ptr<const InteriorEmbedding> embedding;  ///< null where straight distances serve

 private:
  std::uint64_t seed_;
  mutable OneAtATime<std::shared_ptr<const FollowedPlaces>> followed_;
};

/// 0, 1 or 2; −1 for none.
inline int axis_of(SymmetryPlane plane) { return static_cast<int>(plane) - 1; }

/// The samples in a frame whose center lies on the plane of mesh coordinates where one of them is 0: there a
/// reflection across it changes a sign and rounds nothing.
inline SurfaceSamples across(const SurfaceSamples& samples, int axis) {
  SurfaceSamples result = samples;
  result.points.col(axis).array() += samples.frame.center[axis] / samples.frame.scale;
  result.frame.center[axis] = 0.0;
  result.redraw = nullptr;  // its samples are in the other frame
  return result;
}

}  // namespace arapfields
