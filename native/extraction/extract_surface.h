// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "core/frame.h"
#include "core/implicit.h"
#include "core/task.h"
#include "mesh/triangle_mesh.h"
#include "options/extraction.h"

namespace arapfields {

/// Evaluations and topology of a call of extract_surface.
struct ExtractionReport {
  Index evaluations = 0;        ///< points at which Φ was evaluated, those with gradients included
  Index dense_evaluations = 0;  ///< points of the grid
  Index pieces = 0;             ///< parts of the mesh that share no vertex
  Index thin_cells = 0;         ///< at parts thinner than two cells
  int refinement = 1;           ///< steps into which an edge of these was cut
  /// Where the surface came apart there: a resolution that holds it in fewer pieces, if one does, else 0.
  int holding_resolution = 0;
  std::vector<std::string> notes;  ///< a sentence on that
  bool open = false;  ///< the mesh has a boundary: the surface leaves the cube, or ends at a hole
  double seconds = 0.0;
};

/// {Φ = 0} in mesh coordinates by marching cubes on the grid of `resolution`³ points (8 to 512) over the cube
/// [-1,1]³: the vertices that the whole grid's values would give, from values near the surface alone. Where Φ
/// jumps from one sign to the other there is no surface. With `refine_thin`, cells at parts thinner than two
/// of them are cut into finer ones. Throws InvalidInput for a bad resolution, a function that is not finite,
/// or one that has no zero surface which the grid resolves.
ARAPFIELDS_EXPORT TriangleMesh extract_surface(const ImplicitFunction& function,
                                               const ExtractionOptions& options,
                                               const Progress& progress = {},
                                               ExtractionReport* report = nullptr);
inline TriangleMesh extract_surface(const ImplicitFunction& function,
                                    int resolution = ExtractionOptions().resolution,
                                    const Progress& progress = {}, ExtractionReport* report = nullptr) {
  return extract_surface(function, ExtractionOptions{.resolution = resolution}, progress, report);
}

}  // namespace arapfields
