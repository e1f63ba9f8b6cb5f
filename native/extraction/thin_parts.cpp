// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/thin_parts.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "extraction/adaptive_mesh.h"

namespace arapfields {
namespace {

constexpr int factors[] = {2, 3, 4, 6, 8};
constexpr int patience = 3;  // factors in a row that change nothing
constexpr int around = 2;    // steps in which a part that is not thin is a cell deep

bool lies_deep(const SparseGrid& grid, const Place& place) {
  const int last = grid.resolution() - 1;
  const double step = grid.coordinate(1) - grid.coordinate(0);
  for (int i = std::max(0, place[0] - around); i <= std::min(last, place[0] + around); ++i)
    for (int j = std::max(0, place[1] - around); j <= std::min(last, place[1] + around); ++j)
      for (int k = std::max(0, place[2] - around); k <= std::min(last, place[2] + around); ++k)
        if (grid.value(i, j, k) < -step) return true;
  return false;
}

/// Whether a point that is inside lies alone between two that are outside, along some axis.
bool lies_alone(const SparseGrid::Window& window, int i, int j, int k) {
  const auto outside = [&](int x, int y, int z) {
    return window.value[SparseGrid::Window::at(x, y, z)] >= 0.0f;  // false beyond the cube
  };
  return (outside(i - 1, j, k) && outside(i + 1, j, k)) || (outside(i, j - 1, k) && outside(i, j + 1, k)) ||
         (outside(i, j, k - 1) && outside(i, j, k + 1));
}

/// Whether the surface comes nearer to a point than half a step, though no point around is inside.
bool passes_unseen(const SparseGrid::Window& window, int i, int j, int k, double step) {
  if (!(window.value[SparseGrid::Window::at(i, j, k)] < 0.5 * step)) return false;
  for (int n = 0; n < 27; ++n)
    if (window.value[SparseGrid::Window::at(i + n / 9 - 1, j + n / 3 % 3 - 1, k + n % 3 - 1)] < 0.0f)
      return false;
  return true;
}

void add_cells_at(const Place& point, int last, std::set<Place>& cells) {
  for (int n = 0; n < 8; ++n) {
    const Place cell{point[0] - (n >> 2), point[1] - ((n >> 1) & 1), point[2] - (n & 1)};
    const auto [low, high] = std::minmax({cell[0], cell[1], cell[2]});
    if (low >= 0 && high <= last) cells.insert(cell);
  }
}

/// What is to be cut up next: into what the thin parts go on.
std::set<Place> further_cells(const FineGrid& fine, const ThinCells& thin) {
  std::set<Place> cells = cells_to_cut(fine), at_ends;
  for (const Place& cell : fine.cells())
    for (int c = 0; c < 8; ++c) {
      const Place corner{cell[0] + (c >> 2), cell[1] + ((c >> 1) & 1), cell[2] + (c & 1)};
      if (thin.ends.contains(corner)) add_cells_at(corner, fine.coarse().resolution() - 2, at_ends);
    }
  for (const Place& cell : at_ends)
    if (!fine.cut(cell)) cells.insert(cell);
  return cells;
}

}  // namespace

ThinCells thin_cells(const SparseGrid& grid) {
  constexpr int side = SparseGrid::side;
  const double step = grid.coordinate(1) - grid.coordinate(0);
  ThinCells result;
  for (const SparseGrid::Block& block : grid.blocks()) {
    SparseGrid::Window window;
    grid.load(block, window);
    for (int at = 0; at < SparseGrid::points; ++at) {
      const int i = at / (side * side), j = at / side % side, k = at % side;
      const Place place{block.place[0] * side + i, block.place[1] * side + j, block.place[2] * side + k};
      const bool inside = block.value[at] < 0.0f;
      if (!(inside ? lies_alone(window, i, j, k) : passes_unseen(window, i, j, k, step))) continue;
      if (inside && lies_deep(grid, place))
        result.ends.insert(place);
      else
        add_cells_at(place, grid.resolution() - 2, result.cells);
    }
  }
  return result;
}

Index piece_count(const TriangleMesh& mesh) {
  std::vector<Index> parent(mesh.vertices.rows());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](Index i) {
    while (parent[i] != i) {
      Index& up = parent[i];
      up = parent[up];
      i = up;
    }
    return i;
  };
  Index pieces = mesh.vertices.rows();
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int c = 1; c < 3; ++c) {
      const Index a = root(mesh.triangles(t, 0)), b = root(mesh.triangles(t, c));
      if (a == b) continue;
      parent[std::max(a, b)] = std::min(a, b);
      --pieces;
    }
  return pieces;
}

std::optional<HeldParts> hold_thin_parts(const SparseGrid& grid, const ThinCells& thin, Index pieces,
                                         int most, double slope, EvaluationCounter& function) {
  std::optional<HeldParts> held;
  int unchanged = 0;
  for (const int factor : factors) {
    if ((grid.resolution() - 1) * factor + 1 > most) break;
    FineGrid fine(grid, factor);
    for (std::set<Place> cells = thin.cells; !cells.empty(); cells = further_cells(fine, thin)) {
      function.progress().check();
      fine.cut(cells, slope, function);
    }
    TriangleMesh mesh = adaptive_mesh(fine);
    const Index now = piece_count(mesh);
    unchanged = now == (held ? held->pieces : pieces) ? unchanged + 1 : 0;
    if (!held || now != held->pieces) held = {std::move(mesh), now, factor};
    if (now == 1 || unchanged == patience) break;
  }
  return held;
}

}  // namespace arapfields
