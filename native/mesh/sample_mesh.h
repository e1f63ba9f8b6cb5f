// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
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
    Vec3 corners;  ///< shares of the triangle's corners in the point
  };
  Draw draw(Random& random) const;
  Vec3 unit_normal(Index triangle) const;
  double area() const { return cumulative_.back(); }
  /// Corners of triangles, `most` at most, that lie farther than `reach` from all of these points (n,3), and
  /// about as far from each other.
  std::vector<Draw> missed(PointsIn points, double reach, Index most) const;

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

/// Stiffness at a mesh's vertices (n each, ≥ 0; empty: all 1): factors of the samples' energies, and of their
/// bending. Between vertices they are interpolated linearly.
struct VertexWeights {
  Vector weights = {}, bend_weights = {};
};

/// `count` independent points, uniform by area, with their triangles' unit normals, in cube coordinates of
/// area_frame(). Sample i depends on the seed and i alone, but where all miss small things that are far from
/// the rest: the last ones lie on these. Throws InvalidInput as AreaSampler does, and for weights of another
/// number, negative or not finite.
ARAPFIELDS_EXPORT SurfaceSamples sample_mesh(PointsIn vertices, TrianglesIn triangles, Index count,
                                             std::uint64_t seed, const VertexWeights& painted = {});

/// The same for several meshes that deform as one. The first is the body, whose frame the samples have. Each
/// mesh gets samples in proportion to its area. `painted` has an entry for each mesh, or none. Throws
/// InvalidInput that names the mesh.
ARAPFIELDS_EXPORT SurfaceSamples sample_meshes(const std::vector<TriangleMesh>& meshes, Index count,
                                               std::uint64_t seed,
                                               const std::vector<VertexWeights>& painted = {});

/// Throws InvalidInput naming `argument` unless weights are `count` finite numbers, none negative, or empty.
ARAPFIELDS_EXPORT void require_weights(const std::string& argument, const Vector& weights, Index count);

}  // namespace arapfields
