// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <set>

#include "extraction/sparse_grid.h"
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

/// Coarse cells beside those that are cut up in which the surface is not what their own corners say: it
/// passes an edge twice, or comes in through a face and they do not see it. Cut up too, they leave the mesh
/// as it is between coarse cells and fine ones.
std::set<Place> cells_to_cut(const FineGrid& grid);

/// Marching cubes on coarse cells and, where they are cut up, on fine ones, in cube coordinates. A coarse
/// cell beside fine ones takes over the curves in which the surface cuts their faces, and fills the loops
/// that the curves on all its faces form (as in Kazhdan, Klein, Dalal, Hoppe 2007, "Unconstrained isosurface
/// extraction on arbitrary octrees"): both sides of a face have the same curve, so that there are no cracks
/// and the mesh is a manifold.
TriangleMesh adaptive_mesh(const FineGrid& grid);

}  // namespace arapfields
