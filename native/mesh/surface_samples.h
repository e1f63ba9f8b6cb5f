// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/frame.h"
#include "core/types.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Points distributed uniformly over a rest surface, in cube coordinates, with outward unit normals.
struct SurfaceSamples {
  Points points;   ///< (n,3)
  Points normals;  ///< (n,3)
  Frame frame;     ///< cube ↔ mesh coordinates; fields solved on the samples inherit it
  /// Draws `count` other samples of the same surface, in the same frame; empty where the surface is not
  /// known.
  std::function<SurfaceSamples(Index count, std::uint64_t seed)> redraw;
  Vector weights = {};                          ///< (n; empty: all 1) ≥ 0, factors of the samples' energies
  Vector bend_weights = {};                     ///< (n; empty: all 1) ≥ 0, factors of the bending in them
  std::vector<std::int32_t> mesh_indices = {};  ///< (n; empty: all 0) which of several meshes each lies on
  /// (n; empty: all 0) square root of the area of the open sheet that each lies on, in cube units; 0: on no
  /// sheet.
  Vector sheet_sizes = {};
  std::shared_ptr<const TriangleMesh> mesh = {};  ///< that they lie on, in mesh coordinates; null: not known
  Index size() const { return points.rows(); }
};

}  // namespace arapfields
