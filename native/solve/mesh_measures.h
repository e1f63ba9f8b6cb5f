// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "energies/distortion.h"
#include "fields/field.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// What a field does to a mesh's own triangles. Of meshes with more than `most_measured` triangles, those
/// with the longest edges are looked at, which are the first to go wrong.
struct MeshMeasures {
  static constexpr Index most_measured = 20'000;
  Distortion distortion;  ///< at the triangles' middles
  Index measured = 0;     ///< triangles
  Index folded = 0;       ///< of them, those with det J ≤ 0 at their middles
  Index turned = 0;       ///< of them, those whose corners turn it over where the field itself does not fold
  double turned_share = 0.0;          ///< of the measured area
  Vec3 turned_place = Vec3::Zero();   ///< middle of the largest of them, in mesh coordinates at rest
  double longest_edge = 1.0;          ///< largest ratio of an edge's length to that at rest
  Vec3 longest_place = Vec3::Zero();  ///< middle of that edge
};

/// `mesh` is in mesh coordinates; triangles without area and edges without length are passed over.
MeshMeasures measure_triangles(const DeformationField& field, const TriangleMesh& mesh);

/// Sentences that tell of triangles that turn over and of edges that grow long, each with a place.
std::vector<std::string> warnings_on(const MeshMeasures& measures);

}  // namespace arapfields
