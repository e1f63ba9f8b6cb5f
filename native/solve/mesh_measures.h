// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "energies/distortion.h"
#include "fields/field.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Points (n,3) of a mesh at rest with the unit normals (n,3) of their triangles, in mesh coordinates.
struct MeshPlaces {
  Points points = Points(0, 3), normals = Points(0, 3);
};

/// Of a place of a mesh: det J below which, and the largest singular value of J above which, it is wrong.
struct DistortionLimits {
  double least_determinant = 0.0;
  double most_stretch = std::numeric_limits<double>::infinity();
};

/// What a field does to a mesh's own triangles. Of meshes with more than `most_measured` triangles, those
/// with the longest edges are looked at, which are the first to go wrong.
struct MeshMeasures {
  static constexpr Index most_measured = 200'000, most_wrong = 2000;
  Distortion distortion;  ///< at the triangles' middles, and near the corners of those that change much
  Index measured = 0;     ///< triangles
  Index folded = 0;       ///< of them, those with det J ≤ 0 at a place that was looked at
  Vec3 folded_place = Vec3::Zero();  ///< the one with the smallest det J, in mesh coordinates at rest
  Index turned = 0;  ///< of them, those whose corners turn it over where the field itself does not fold
  double turned_share = 0.0;          ///< of the measured area
  Vec3 turned_place = Vec3::Zero();   ///< middle of the largest of them, in mesh coordinates at rest
  double longest_edge = 1.0;          ///< largest ratio of an edge's length to that at rest
  Vec3 longest_place = Vec3::Zero();  ///< middle of that edge
  bool is_wrong = false;              ///< whether det J ≤ 0, or J stretches more than it may, somewhere
  MeshPlaces wrong;                   ///< places beyond the limits, `most_wrong` at most
  /// Whether more than a few triangles turn over; slivers do at a touch.
  bool has_long_triangles() const {
    return static_cast<double>(turned) > 0.002 * static_cast<double>(measured);
  }
};

/// `mesh` is in mesh coordinates; triangles without area and edges without length are passed over.
MeshMeasures measure_triangles(const DeformationField& field, const TriangleMesh& mesh,
                               const DistortionLimits& limits = {});

/// Sentences that tell of folds, of triangles that turn over and of edges that grow long, each with a place.
std::vector<std::string> warnings_on(const MeshMeasures& measures);

}  // namespace arapfields
