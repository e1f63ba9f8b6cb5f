// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"
#include "mesh/surface_samples.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Draws points of a mesh with equal probability per area. Coordinates are those of the given vertices.
class ARAPFIELDS_EXPORT AreaSampler {
 public:
  /// Throws InvalidInput for a mesh that validate() refuses and for one whose triangles have no area.
  AreaSampler(PointsIn vertices, TrianglesIn triangles);

  struct Draw {
    Vec3 point;
    Index triangle;
  };
  Draw draw(Random& random) const;
  Vec3 unit_normal(Index triangle) const;

 private:
  Points vertices_;
  Triangles triangles_;
  std::vector<double> cumulative_;  // area of triangles 0..t
};

/// The frame of a surface: the centroid of its area and its radius of gyration (core/frame.h). Long shapes
/// leave the unit cube.
ARAPFIELDS_EXPORT Frame area_frame(PointsIn vertices, TrianglesIn triangles);

/// area_frame(), enlarged where the mesh would not lie in the unit ball with some room around it: for
/// functions that are known in the cube alone.
ARAPFIELDS_EXPORT Frame mesh_frame(PointsIn vertices, TrianglesIn triangles);

/// `count` independent points, uniform by area, with their triangles' unit normals, in cube coordinates of
/// area_frame(). Sample i depends on the seed and i alone. Throws InvalidInput as AreaSampler does.
ARAPFIELDS_EXPORT SurfaceSamples sample_mesh(PointsIn vertices, TrianglesIn triangles, Index count,
                                             std::uint64_t seed);

}  // namespace arapfields
