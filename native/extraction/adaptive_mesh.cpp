// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/adaptive_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "extraction/cell.h"

namespace arapfields {
namespace {

constexpr int factors[] = {2, 3, 4, 6, 8};
constexpr int patience = 3;      // factors in a row that change nothing
constexpr int steps_around = 2;  // steps in which a part that is not thin is a cell deep

bool lies_deep(const SparseGrid& grid, const Place& place) {
  const int last = grid.resolution() - 1;
  const double step = grid.coordinate(1) - grid.coordinate(0);
  for (int i = std::max(0, place[0] - steps_around); i <= std::min(last, place[0] + steps_around); ++i)
    for (int j = std::max(0, place[1] - steps_around); j <= std::min(last, place[1] + steps_around); ++j)
      for (int k = std::max(0, place[2] - steps_around); k <= std::min(last, place[2] + steps_around); ++k)
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

namespace {

/// An edge of the fine grid, or `length` of them in a row: one of the coarse grid.
struct Edge {
  Place low;
  int axis, length;
  auto operator<=>(const Edge&) const = default;
};

Place moved(Place place, int axis, int by) {
  place[axis] += by;
  return place;
}

/// What the surface does on the faces of a cell: for each edge on which it enters a face's inside, going
/// around the face counter-clockwise, the edge at which it came in.
using Curves = std::map<Edge, Edge>;

/// The closed loops that curves form.
std::vector<std::vector<Edge>> loops_of(Curves curves) {
  std::vector<std::vector<Edge>> loops;
  while (!curves.empty()) {
    std::vector<Edge>& loop = loops.emplace_back();
    for (auto at = curves.begin(); at != curves.end();) {
      loop.push_back(at->first);
      const Edge next = at->second;
      curves.erase(at);
      at = curves.find(next);
    }
  }
  return loops;
}

class Mesher {
 public:
  explicit Mesher(const FineGrid& grid) : grid_(grid), factor_(grid.factor()) {}

  std::set<Place> cells_beside() const {
    std::set<Place> beside;
    const int last = grid_.coarse().resolution() - 2;
    for (const Place& cell : grid_.cells())
      for (int n = 0; n < 27; ++n) {
        const Place next{cell[0] + n / 9 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n % 3 - 1};
        const auto [low, high] = std::minmax({next[0], next[1], next[2]});
        if (low >= 0 && high <= last && !grid_.cut(next)) beside.insert(next);
      }
    return beside;
  }

  /// The curves on a coarse cell's faces; `blocked` gets the cells around edges that are passed twice.
  Curves curves(const Place& cell, bool with_fine, std::set<Place>* blocked) const {
    Curves result;
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, side = face & 1, u = (axis + 1) % 3, v = (axis + 2) % 3;
      const bool fine = with_fine && grid_.cut(moved(cell, axis, side == 1 ? 1 : -1));
      const int parts = fine ? factor_ : 1, step = fine ? 1 : factor_;
      const Place base{cell[0] * factor_, cell[1] * factor_, cell[2] * factor_};
      for (int a = 0; a < parts; ++a)
        for (int b = 0; b < parts; ++b) {
          Place from = moved(moved(base, u, a), v, b);
          if (side == 1) from = moved(from, axis, factor_ - step);
          trace(face, from, step, with_fine, result, blocked);
        }
    }
    return result;
  }

  int vertex(const Edge& edge) {
    const auto [entry, inserted] = numbers_.try_emplace(edge, static_cast<int>(vertices_.size()));
    if (inserted) {
      const Place high = moved(edge.low, edge.axis, edge.length);
      const double a = std::abs(grid_.value(edge.low)), b = std::abs(grid_.value(high));
      const double t = std::clamp(a + b > 0.0 ? a / (a + b) : 0.5, Cell::clearance, 1.0 - Cell::clearance);
      const Vec3 from = grid_.position(edge.low);
      vertices_.push_back(from + t * (grid_.position(high) - from));
    }
    return entry->second;
  }

  /// An uncut cell, coarse (step = factor) or fine (1), by the table.
  void add_cell(const Place& from, int step) {
    const Cell cell([&](int i, int j, int k) {
      return grid_.value({from[0] + step * i, from[1] + step * j, from[2] + step * k});
    });
    if (!cell.crossed()) return;
    int own = -1;
    for (const auto& t : cell.triangles()) {
      std::array<int, 3> triangle;
      for (std::size_t c = 0; c < 3; ++c) {
        if (t[c] != CellTable::centre) {
          const int corner = CellTable::edge_corner(t[c]);
          const Place low{from[0] + step * CellTable::corner_at(corner, 0),
                          from[1] + step * CellTable::corner_at(corner, 1),
                          from[2] + step * CellTable::corner_at(corner, 2)};
          triangle[c] = vertex({low, CellTable::edge_axis(t[c]), step});
          continue;
        }
        if (own < 0) {
          own = static_cast<int>(vertices_.size());
          vertices_.push_back(cell.centre([&](int corner) {
            return grid_.position({from[0] + step * CellTable::corner_at(corner, 0),
                                   from[1] + step * CellTable::corner_at(corner, 1),
                                   from[2] + step * CellTable::corner_at(corner, 2)});
          }));
        }
        triangle[c] = own;
      }
      triangles_.push_back(triangle);
    }
  }

  /// A coarse cell beside fine ones: each loop is filled.
  void add_loops(Curves curves) {
    for (const std::vector<Edge>& edges : loops_of(std::move(curves))) {
      std::vector<int> loop;
      for (const Edge& edge : edges) loop.push_back(vertex(edge));
      const std::size_t n = loop.size();
      if (n == 3) {
        triangles_.push_back({loop[2], loop[1], loop[0]});
        continue;
      }
      Vec3 centre = Vec3::Zero();
      for (const int each : loop) centre += vertices_[each] / static_cast<double>(n);
      const int own = static_cast<int>(vertices_.size());
      vertices_.push_back(centre);
      for (std::size_t i = 0; i < n; ++i) triangles_.push_back({loop[(i + 1) % n], loop[i], own});
    }
  }

  TriangleMesh mesh() const {
    TriangleMesh result{Points(static_cast<Index>(vertices_.size()), 3),
                        Triangles(static_cast<Index>(triangles_.size()), 3)};
    for (std::size_t i = 0; i < vertices_.size(); ++i) result.vertices.row(i) = vertices_[i].transpose();
    for (std::size_t i = 0; i < triangles_.size(); ++i)
      result.triangles.row(i) << triangles_[i][0], triangles_[i][1], triangles_[i][2];
    return result;
  }

 private:
  /// The curve on one square of a face. Going around it counter-clockwise seen from outside the cell, a curve
  /// leads from an edge that leaves the inside to the one before the run of inside corners where these are
  /// separate, and to the one behind the run of outside corners where they are joined.
  void trace(int face, const Place& from, int step, bool with_fine, Curves& out,
             std::set<Place>* blocked) const {
    const auto corners = CellTable::face_corners(face);
    std::array<Place, 4> places;
    std::array<float, 4> values;
    unsigned inside = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      for (int axis = 0; axis < 3; ++axis)
        places[i][axis] = from[axis] + step * CellTable::corner_at(corners[i], axis);
      values[i] = grid_.value(places[i]);
      inside |= values[i] < 0.0f ? 1u << i : 0u;
    }
    const auto is_inside = [&](unsigned i) { return (inside >> (i & 3u)) & 1u; };
    std::array<Edge, 4> edges{};
    for (unsigned i = 0; i < 4; ++i) {
      const Place &a = places[i], &b = places[(i + 1) & 3u];
      int axis = 0;
      while (a[axis] == b[axis]) ++axis;
      edges[i] = crossing({std::min(a, b), axis, step}, with_fine, blocked);
    }
    if (inside == 0 || inside == 15) return;
    const bool joined = Cell::joined(values);
    for (unsigned i = 0; i < 4; ++i) {
      if (!is_inside(i) || is_inside(i + 1)) continue;  // edge i leaves the inside
      unsigned enter = i;
      if (joined) {
        do ++enter;
        while (is_inside(enter) || !is_inside(enter + 1));
      } else {
        do enter += 3;
        while (is_inside(enter) || !is_inside(enter + 1));
      }
      out.emplace(edges[i], edges[enter & 3u]);
    }
  }

  /// The part of a coarse edge that the surface passes, where a cell at the edge is cut up.
  Edge crossing(const Edge& edge, bool with_fine, std::set<Place>* blocked) const {
    if (edge.length == 1 || !with_fine) return edge;
    const int u = (edge.axis + 1) % 3, v = (edge.axis + 2) % 3;
    const Place cell{edge.low[0] / factor_, edge.low[1] / factor_, edge.low[2] / factor_};
    std::array<Place, 4> around;
    bool cut = false;
    for (int i = 0; i < 4; ++i) {
      around[i] = moved(moved(cell, u, -(i & 1)), v, -(i >> 1));
      cut = cut || grid_.cut(around[i]);
    }
    if (!cut) return edge;
    int passes = 0;
    Edge result = edge;
    for (int part = 0; part < edge.length; ++part) {
      const Place low = moved(edge.low, edge.axis, part), high = moved(low, edge.axis, 1);
      if ((grid_.value(low) < 0.0f) == (grid_.value(high) < 0.0f)) continue;
      result = {low, edge.axis, 1};
      ++passes;
    }
    if (passes > 1 && blocked != nullptr)
      for (const Place& each : around) blocked->insert(each);
    return result;
  }

  const FineGrid& grid_;
  int factor_;
  std::map<Edge, int> numbers_;
  std::vector<Vec3> vertices_;
  std::vector<std::array<int, 3>> triangles_;
};

}  // namespace

std::set<Place> cells_to_cut(const FineGrid& grid) {
  const Mesher mesher(grid);
  const int last = grid.coarse().resolution() - 2;
  std::set<Place> blocked_cells, result;
  for (const Place& cell : mesher.cells_beside()) {
    const std::size_t loops = loops_of(mesher.curves(cell, true, &blocked_cells)).size();
    if (loops != loops_of(mesher.curves(cell, false, nullptr)).size()) blocked_cells.insert(cell);
  }
  for (const Place& cell : blocked_cells) {
    const auto [low, high] = std::minmax({cell[0], cell[1], cell[2]});
    if (low >= 0 && high <= last && !grid.cut(cell)) result.insert(cell);
  }
  return result;
}

TriangleMesh adaptive_mesh(const FineGrid& grid) {
  Mesher mesher(grid);
  const int factor = grid.factor(), last = grid.coarse().resolution() - 2;
  const std::set<Place> beside = mesher.cells_beside();
  for (const SparseGrid::Block& block : grid.coarse().blocks())
    for (int at = 0; at < SparseGrid::points; ++at) {
      const Place cell{block.place[0] * SparseGrid::side + at / (SparseGrid::side * SparseGrid::side),
                       block.place[1] * SparseGrid::side + at / SparseGrid::side % SparseGrid::side,
                       block.place[2] * SparseGrid::side + at % SparseGrid::side};
      if (std::max({cell[0], cell[1], cell[2]}) > last || grid.cut(cell) || beside.contains(cell)) continue;
      mesher.add_cell({cell[0] * factor, cell[1] * factor, cell[2] * factor}, factor);
    }
  for (const Place& cell : beside) mesher.add_loops(mesher.curves(cell, true, nullptr));
  for (const Place& cell : grid.cells())
    for (int n = 0; n < factor * factor * factor; ++n)
      mesher.add_cell({cell[0] * factor + n / (factor * factor), cell[1] * factor + n / factor % factor,
                       cell[2] * factor + n % factor},
                      1);
  return mesher.mesh();
}

}  // namespace arapfields
