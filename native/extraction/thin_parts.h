// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <set>

#include "extraction/fine_grid.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// Where parts are thinner than two cells.
struct ThinCells {
  /// Those at points alone between two that are outside, with no point two steps around that lies a cell
  /// deep; and at points outside to which, as |Φ| is nearly a distance, the surface comes nearer than half a
  /// step, though no point around is inside.
  std::set<Place> cells;
  /// Other points alone between two that are outside: where thin parts end in thick ones, or a mere edge.
  std::set<Place> ends;
};
ThinCells thin_cells(const SparseGrid& grid);

/// Parts of a mesh that share no vertex.
Index piece_count(const TriangleMesh& mesh);

/// The surface with the cells at thin parts cut up, in cube coordinates.
struct HeldParts {
  TriangleMesh mesh;
  Index pieces = 0;
  int factor = 1;  ///< grid steps to a coarse one
};

/// Cuts the cells up, and those that the thin parts go on into, more and more finely until the surface is one
/// piece, or three factors in a row change nothing, or a grid as fine would have more than `most` points a
/// side. The coarsest that gives the number of pieces found; nothing where not even a factor of 2 is allowed.
std::optional<HeldParts> hold_thin_parts(const SparseGrid& grid, const ThinCells& thin, Index pieces,
                                         int most, double slope, EvaluationCounter& function);

}  // namespace arapfields
