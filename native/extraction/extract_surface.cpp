// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/extract_surface.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/task.h"
#include "extraction/adaptive_mesh.h"
#include "extraction/cell.h"
#include "extraction/sparse_grid.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {

/// The zero surface of a refined grid in cube coordinates: one vertex on each edge whose ends differ in sign
/// (zero counts as outside), by linear interpolation; triangles counter-clockwise seen from outside. Where a
/// cell's face has alternating corners, the sign of the bilinear interpolant's saddle joins or separates
/// them (Nielson, Hamann 1991, "The asymptotic decider"), so that neighbouring cells agree: the surface is a
/// closed manifold unless it leaves the cube, where its boundary lies on the cube's faces. A corner and a
/// pair of corners separate on a face may be connected inside the cell (Chernyaev 1995, "Marching cubes 33",
/// case 6.1.2). Cells with such a tunnel, or with a polygon of eight or more corners, get a vertex of their
/// own, the mean of the cell's corners weighted by 1/|Φ|.
TriangleMesh marching_cubes(const SparseGrid& grid, const Progress& progress = {});

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

namespace {

constexpr int smallest_with_model = 32;  // below, the model would cost more than the grid
constexpr int grid_steps_a_cell = 4;
constexpr int grid_steps_a_sure_cell = 2;  // where Φ's own bound on |∇Φ| makes interpolation needless
constexpr int fewest_coarse_cells = 8;     // a side
constexpr int finest_resolution = 512;     // allowed …
constexpr int finest_refined = 2048;       // … and to which thin parts are refined
constexpr Index points_a_thin_cell = 24;   // about, that cutting its edges in three takes

/// Cells of about the same number of grid steps at every resolution.
TricubicSurrogateOptions model_options(int resolution, bool sure) {
  TricubicSurrogateOptions options{.target_cells = std::numeric_limits<Index>::max(), .interpolate = !sure};
  const int finest = resolution / (sure ? grid_steps_a_sure_cell : grid_steps_a_cell);
  int halvings = 0;
  while (finest >> (halvings + 1) >= fewest_coarse_cells) ++halvings;
  options.coarsest = finest >> halvings;
  options.max_cells_a_side = options.coarsest << halvings;
  return options;
}

/// Leaves out the triangles with a corner at which |Φ| exceeds what a crossing of the grid can leave there.
/// Whether there were any.
bool drop_jumps(EvaluationCounter& function, double most, TriangleMesh& mesh) {
  const VectorF values = function.values(mesh.vertices.cast<float>());
  std::vector<std::int32_t> number(mesh.vertices.rows(), -1);
  std::vector<Index> kept, used;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    bool on_surface = true;
    for (int c = 0; c < 3; ++c) on_surface = on_surface && std::abs(values[mesh.triangles(t, c)]) <= most;
    if (!on_surface) continue;
    kept.push_back(t);
    for (int c = 0; c < 3; ++c) {
      std::int32_t& own = number[mesh.triangles(t, c)];
      if (own >= 0) continue;
      own = static_cast<std::int32_t>(used.size());
      used.push_back(mesh.triangles(t, c));
    }
  }
  if (static_cast<Index>(kept.size()) == mesh.triangles.rows()) return false;
  mesh.triangles = Triangles(mesh.triangles(kept, Eigen::all));
  mesh.vertices = Points(mesh.vertices(used, Eigen::all));
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) mesh.triangles(t, c) = number[mesh.triangles(t, c)];
  return true;
}

/// Looks for thin parts and, where they are to be refined, or have come apart and the look is cheap, cuts the
/// cells there up.
void hold_together(const SparseGrid& grid, const TricubicSurrogate* model, bool refine, TriangleMesh& mesh,
                   ExtractionReport& report, EvaluationCounter& function) {
  const ThinCells thin = thin_cells(grid);
  report.pieces = piece_count(mesh);
  report.thin_cells = static_cast<Index>(thin.cells.size());
  const bool cheap = points_a_thin_cell * report.thin_cells <= function.value_count();
  if (thin.cells.empty() || !(refine || (report.pieces > 1 && cheap))) return;
  const std::optional<double> known = function.gradient_bound();
  const double slope = model != nullptr ? model->lipschitz() : known ? *known : measure_lipschitz(function);
  std::optional<HeldParts> held = hold_thin_parts(
      grid, thin, report.pieces, refine ? finest_refined : finest_resolution, slope, function);
  if (!held) return;
  const int resolution = held->factor * (grid.resolution() - 1) + 1;
  if (refine) {
    report.pieces = held->pieces;
    report.refinement = held->factor;
    mesh = std::move(held->mesh);
  } else if (held->pieces < report.pieces) {
    report.holding_resolution = resolution;
    report.notes.push_back("parts are thinner than two cells of the grid: the surface came apart into " +
                           std::to_string(report.pieces) + " pieces; resolution " +
                           std::to_string(resolution) + ", or refine_thin at this one, holds it in " +
                           std::to_string(held->pieces));
  }
}

}  // namespace

TriangleMesh extract_surface(const ImplicitFunction& implicit, const ExtractionOptions& options,
                             const Progress& progress, ExtractionReport* report) {
  options.validate();
  const int resolution = options.resolution;
  const auto start = std::chrono::steady_clock::now();
  progress.report(0.0, "finding the surface");
  EvaluationCounter function(implicit, progress);
  std::optional<TricubicSurrogate> model;
  if (resolution >= smallest_with_model)
    model.emplace(function, model_options(resolution, implicit.gradient_bound().has_value()));
  progress.report(0.4, "evaluating the grid");
  SparseGrid grid(resolution, model ? &*model : nullptr);
  grid.refine(function);
  progress.report(0.9, "marching cubes");
  TriangleMesh mesh = marching_cubes(grid, progress);
  require(mesh.triangles.rows() > 0, "sdf",
          "its values have one sign on the whole grid of " + std::to_string(resolution) + " points a side",
          "a function with a zero surface inside the cube [-1, 1]^3 is needed");
  ExtractionReport done;
  if (implicit.continuous()) {
    hold_together(grid, model ? &*model : nullptr, options.refine_thin, mesh, done, function);
    done.open = (mesh.vertices.array().abs() == 1.0).any();
  } else {
    done.open = (mesh.vertices.array().abs() == 1.0).any();
    const double bound = model ? model->lipschitz() : implicit.gradient_bound().value_or(1.0);
    done.open = drop_jumps(function, 0.5 * bound * 2.0 / (resolution - 1), mesh) || done.open;
    require(mesh.triangles.rows() > 0, "sdf", "its sign changes by jumps alone",
            "a function with a zero surface inside the cube [-1, 1]^3 is needed");
    done.pieces = piece_count(mesh);
  }
  mesh.vertices = implicit.frame().to_mesh(mesh.vertices);
  done.evaluations = function.value_count() + function.gradient_count();
  done.dense_evaluations = static_cast<Index>(resolution) * resolution * resolution;
  done.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (report != nullptr) *report = std::move(done);
  progress.report(1.0, "extracted the surface");
  return mesh;
}

}  // namespace arapfields
