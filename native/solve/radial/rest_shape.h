// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/task.h"
#include "fields/radial_basis.h"
#include "mesh/surface_samples.h"
#include "options/choices.h"
#include "sampling/fine_regions.h"
#include "sampling/local_thickness.h"
#include "sampling/parts.h"

namespace arapfields {

struct FollowedPlaces;

/// Precomputed data of a rest surface that do not depend on handles, shared by all solvers on the same
/// samples. In cube coordinates.
struct RestShape {
  /// `interior`: whether to compute the interior embedding; `axis`: 0, 1 or 2 for fields that are symmetric
  /// across the plane where that coordinate is 0, −1 for others. `may_join` is that of interior_embedding(),
  /// for samples. Throws InvalidInput for no samples and for NaN or infinity among them, Cancelled.
  RestShape(const SurfaceSamples& samples, bool interior, std::uint64_t seed, const Progress& progress,
            int axis = -1, const MayJoin& may_join = {});

  /// The contact points of these samples, chosen at the first call. Throws Cancelled.
  std::shared_ptr<const FollowedPlaces> followed(const SurfaceSamples& samples,
                                                 const Progress& progress) const;

  std::vector<std::uint32_t> order;  ///< spatially coherent permutation of the samples (canonical_order)
  std::shared_ptr<const LocalThickness> thickness;
  std::vector<FineRegion> fine_regions;  ///< where centers and samples of the energy are denser
  Points sites;              ///< (n,3) candidates for centers; with an axis, reflected to one side
  RadialLayout layout;       ///< relative spacing of centers at the sites, and points below them
  std::vector<Index> parts;  ///< connected part of each site, as parts_of()
  std::shared_ptr<const InteriorEmbedding> embedding;  ///< null: Euclidean distances are used

 private:
  /// The centers' layout at the sites, with their normals (none: empty).
  void lay_out(const Points& normals);
  /// Gives the embedding parts at the fine regions, and measures and lays out these anew. With an axis, the
  /// regions are those of one side, and get their reflections. `normals` become those of all sites.
  void refine(InteriorEmbedding& own, Points& normals, const MakeSight& make_sight, int axis,
              const Progress& progress);

  std::uint64_t seed_;
  mutable OneAtATime<std::shared_ptr<const FollowedPlaces>> followed_;
};

/// The axis of a symmetry plane's normal: 0, 1 or 2; −1 for none.
inline int axis_of(SymmetryPlane plane) { return static_cast<int>(plane) - 1; }

/// The samples in a frame whose center lies on the plane where the mesh coordinate `axis` is 0, so that in
/// the cube a reflection across it is an exact change of sign.
inline SurfaceSamples across(const SurfaceSamples& samples, int axis) {
  SurfaceSamples result = samples;
  result.points.col(axis).array() += samples.frame.center[axis] / samples.frame.scale;
  result.frame.center[axis] = 0.0;
  result.redraw = nullptr;  // its samples are in the other frame
  return result;
}

}  // namespace arapfields
