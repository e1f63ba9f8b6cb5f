// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/marching_cubes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>

#include "core/errors.h"
#include "core/parallel.h"
#include "extraction/cell.h"

namespace arapfields {
namespace {

using Window = SparseGrid::Window;
constexpr int side = SparseGrid::side;
/// Where a block's vertices are in the mesh. Slots are 3·local + axis for the edge from a point along an
/// axis.
struct Numbers {
  Index first = 0;  // the block's first vertex in the mesh
  std::vector<std::int16_t>
      slots;                 // vertex of each slot, counted from `first`; −1 for none; empty if all are
  std::vector<int> centres;  // local cells with a vertex of their own, ascending
  Index edges = 0;
  Index count() const { return edges + static_cast<Index>(centres.size()); }
};

Cell cell_at(const Window& window, int i, int j, int k) {
  return Cell([&](int x, int y, int z) { return window.value[Window::at(i + x, j + y, k + z)]; });
}

using EachCell = std::function<void(int, int, int)>;

void for_each_point(const EachCell& body) {
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < side; ++k) body(i, j, k);
}

bool mixed(const Window& window) {
  bool negative = false, positive = false;
  for (const float value : window.value) {
    negative = negative || value < 0.0f;
    positive = positive || value >= 0.0f;
  }
  return negative && positive;
}

Numbers number(const SparseGrid& grid, const SparseGrid::Block& block) {
  Numbers numbers;
  Window window;
  grid.load(block, window);
  if (!mixed(window)) return numbers;
  numbers.slots.assign(3 * SparseGrid::points, -1);
  for_each_point([&](int i, int j, int k) {
    const float low = window.value[Window::at(i, j, k)];
    for (int axis = 0; axis < 3; ++axis) {
      const float high = window.value[Window::at(i + (axis == 0), j + (axis == 1), k + (axis == 2))];
      if (std::isnan(low) || std::isnan(high) || (low < 0.0f) == (high < 0.0f)) continue;
      numbers.slots[3 * SparseGrid::local(i, j, k) + axis] = static_cast<std::int16_t>(numbers.edges++);
    }
    const Cell cell = cell_at(window, i, j, k);
    if (!cell.crossed()) return;
    const auto& triangles = cell.triangles();
    if (triangles.front()[2] == CellTable::centre || triangles.back()[2] == CellTable::centre)
      numbers.centres.push_back(SparseGrid::local(i, j, k));
  });
  return numbers;
}

/// One block's part of the mesh.
class Tile {
 public:
  Tile(const SparseGrid& grid, const std::vector<Numbers>& numbers, Index block)
      : grid_(grid), block_(grid.blocks()[block]), own_(numbers[block]) {
    grid.load(block_, window_);
    for (int n = 0; n < 8; ++n) {
      const Index neighbour =
          grid.find(block_.place[0] + (n >> 2), block_.place[1] + ((n >> 1) & 1), block_.place[2] + (n & 1));
      around_[n] = neighbour < 0 ? nullptr : &numbers[neighbour];
    }
  }

  void edge_vertices(Points& vertices) const {
    for_each_point([&](int i, int j, int k) {
      for (int axis = 0; axis < 3; ++axis) {
        const int slot = own_.slots[3 * SparseGrid::local(i, j, k) + axis];
        if (slot < 0) continue;
        const int next[3] = {i + (axis == 0), j + (axis == 1), k + (axis == 2)};
        const double low = std::abs(window_.value[Window::at(i, j, k)]);
        const double high = std::abs(window_.value[Window::at(next[0], next[1], next[2])]);
        const double t = std::clamp(low / (low + high), Cell::clearance, 1.0 - Cell::clearance);
        const int local[3] = {i, j, k};
        for (int a = 0; a < 3; ++a) {
          const int index = block_.place[a] * side + local[a];
          const double from = grid_.coordinate(index);
          vertices(own_.first + slot, a) = a == axis ? from + t * (grid_.coordinate(index + 1) - from) : from;
        }
      }
    });
  }

  /// Needs the edge vertices of all blocks.
  void triangles(Points& vertices, std::vector<std::array<std::int32_t, 3>>& out) const {
    std::size_t centre = 0;
    for_each_point([&](int i, int j, int k) {
      const Cell cell = cell_at(window_, i, j, k);
      if (!cell.crossed()) return;
      const auto& list = cell.triangles();
      Index own_vertex = -1;
      if (centre < own_.centres.size() && own_.centres[centre] == SparseGrid::local(i, j, k)) {
        own_vertex = own_.first + own_.edges + static_cast<Index>(centre++);
        vertices.row(own_vertex) = cell.centre([&](int c) {
          const int at[3] = {i, j, k};
          Vec3 position;
          for (int a = 0; a < 3; ++a)
            position[a] = grid_.coordinate(block_.place[a] * side + at[a] + CellTable::corner_at(c, a));
          return position;
        });
      }
      for (const auto& t : list) {
        std::array<std::int32_t, 3> triangle;
        for (std::size_t c = 0; c < 3; ++c)
          triangle[c] =
              static_cast<std::int32_t>(t[c] == CellTable::centre ? own_vertex : vertex(i, j, k, t[c]));
        out.push_back(triangle);
      }
    });
  }

 private:
  Index vertex(int i, int j, int k, int edge) const {
    const int corner = CellTable::edge_corner(edge);
    const int x = i + CellTable::corner_at(corner, 0), y = j + CellTable::corner_at(corner, 1),
              z = k + CellTable::corner_at(corner, 2);
    const Numbers& owner = *around_[4 * (x / side) + 2 * (y / side) + z / side];
    const int slot = 3 * SparseGrid::local(x % side, y % side, z % side) + CellTable::edge_axis(edge);
    return owner.first + owner.slots[slot];
  }

  const SparseGrid& grid_;
  const SparseGrid::Block& block_;
  const Numbers& own_;
  const Numbers* around_[8];
  Window window_;
};

}  // namespace

TriangleMesh marching_cubes(const SparseGrid& grid, const Progress& progress) {
  const auto count = static_cast<Index>(grid.blocks().size());
  const auto for_each_block = [&](const std::function<void(Index)>& body) {
    parallel_for(0, count, 8, [&](Index begin, Index end) {
      for (Index b = begin; b < end && !progress.cancelled(); ++b) body(b);
    });
    progress.check();
  };
  // Vertices are numbered block by block in the order of the grid, in which later blocks need not be stored.
  std::vector<Numbers> numbers(grid.blocks().size());
  for_each_block([&](Index b) { numbers[b] = number(grid, grid.blocks()[b]); });
  Index total = 0;
  for (Numbers& each : numbers) {
    each.first = total;
    total += each.count();
  }
  require(total < INT32_MAX, "resolution", std::to_string(total) + " vertices",
          "at most 2^31 can be numbered");

  TriangleMesh mesh;
  mesh.vertices.resize(total, 3);
  for_each_block([&](Index b) {
    if (!numbers[b].slots.empty()) Tile(grid, numbers, b).edge_vertices(mesh.vertices);
  });
  std::vector<std::vector<std::array<std::int32_t, 3>>> parts(numbers.size());
  for_each_block([&](Index b) {
    if (!numbers[b].slots.empty()) Tile(grid, numbers, b).triangles(mesh.vertices, parts[b]);
  });
  Index triangles = 0;
  for (const auto& part : parts) triangles += static_cast<Index>(part.size());
  mesh.triangles.resize(triangles, 3);
  Index row = 0;
  for (const auto& part : parts)
    for (const auto& each : part) mesh.triangles.row(row++) << each[0], each[1], each[2];
  return mesh;
}

}  // namespace arapfields
