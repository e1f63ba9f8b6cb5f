// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/cell.h"

#include <algorithm>
#include <bit>

namespace arapfields {
namespace {

/// Whether a plane across an axis cuts the cell so that two opposite corners of the cut are negative, the
/// others positive, and the bilinear interpolant between them joins the negative ones.
bool joined_across(const double (&corner)[8], int axis) {
  const int u = 1 << (2 - (axis + 1) % 3), v = 1 << (2 - (axis + 2) % 3), w = 1 << (2 - axis);
  for (const bool other : {false, true}) {
    const int lines[4] = {other ? u : 0, other ? v : u | v, other ? 0 : u, other ? u | v : v};
    double from = 0.0, to = 1.0;  // where lines 0, 1 are negative and 2, 3 positive
    double low[4], rate[4];
    for (int i = 0; i < 4; ++i) {
      low[i] = corner[lines[i]];
      rate[i] = corner[lines[i] | w] - low[i];
      const double value = i < 2 ? low[i] : -low[i], slope = i < 2 ? rate[i] : -rate[i];
      if (slope > 0.0) to = std::min(to, -value / slope);
      if (slope < 0.0) from = std::max(from, -value / slope);
      if (slope == 0.0 && value >= 0.0) to = -1.0;
    }
    // (line 0)(line 1) − (line 2)(line 3) = a t² + b t + c; not positive at either end of the range.
    const double a = rate[0] * rate[1] - rate[2] * rate[3];
    const double b = low[0] * rate[1] + low[1] * rate[0] - low[2] * rate[3] - low[3] * rate[2];
    const double c = low[0] * low[1] - low[2] * low[3], t = -0.5 * b / a;
    if (from < to && a < 0.0 && t > from && t < to && (a * t + b) * t + c > 0.0) return true;
  }
  return false;
}

}  // namespace

bool Cell::joined(const std::array<float, 4>& corners) {
  // The saddle's value has the sign of (product of the outside corners) − (product of the inside ones).
  double inside = 1.0, outside = 1.0;
  for (const float value : corners) (value < 0.0f ? inside : outside) *= value;
  return outside < inside;
}

const std::vector<std::array<std::uint8_t, 3>>& Cell::triangles() const {
  const CellTable& table = CellTable::get();
  const unsigned faces = table.ambiguous(pattern);
  unsigned joined_faces = 0;
  for (int face = 0; faces != 0 && face < 6; ++face) {
    if (!((faces >> face) & 1u)) continue;
    const auto c = CellTable::face_corners(face);
    if (joined({corner[c[0]], corner[c[1]], corner[c[2]], corner[c[3]]})) joined_faces |= 1u << face;
  }
  const auto& tunnel = table.tunnel(pattern);
  const bool many_inside = std::popcount(pattern) > 4;  // then the outside corners are the ones to connect
  if (!tunnel.empty() && (joined_faces != 0) == many_inside) {
    double signed_corner[8];
    for (int i = 0; i < 8; ++i) signed_corner[i] = many_inside ? -corner[i] : corner[i];
    for (int axis = 0; axis < 3; ++axis)
      if (joined_across(signed_corner, axis)) return tunnel;
  }
  return table.triangles(pattern, joined_faces);
}

namespace {

constexpr int shortest_fan = 8;

using Loop = std::vector<int>;
using Triples = std::vector<std::array<std::uint8_t, 3>>;

int edge_between(int a, int b) {
  const int low = std::min(a, b), difference = a ^ b;
  const int axis = difference == 4 ? 0 : difference == 2 ? 1 : 2;
  return 4 * axis + 2 * CellTable::corner_at(low, (axis + 1) % 3) + CellTable::corner_at(low, (axis + 2) % 3);
}

bool on_face(int edge, int face) {
  const auto corners = CellTable::face_corners(face);
  for (std::size_t i = 0; i < 4; ++i)
    if (edge_between(corners[i], corners[(i + 1) % 4]) == edge) return true;
  return false;
}

bool share_face(int a, int b) {
  for (int face = 0; face < 6; ++face)
    if (on_face(a, face) && on_face(b, face)) return true;
  return false;
}

/// The closed polygons in which the surface cuts the cell's boundary. Going around a face counter-clockwise,
/// a segment leads from every edge that leaves the inside to one that enters it: to the one before the run
/// of inside corners where these are separate, to the one behind the run of outside corners where joined.
/// The loops run clockwise seen from outside the surface. The neighbour cell goes around the same face the
/// other way, so its segment runs backwards.
std::vector<Loop> trace(unsigned pattern, unsigned joined) {
  std::array<int, 12> next;
  next.fill(-1);
  for (int face = 0; face < 6; ++face) {
    const auto corners = CellTable::face_corners(face);
    const auto inside = [&](int i) { return (pattern >> corners[i & 3]) & 1u; };
    const auto edge = [&](int i) { return edge_between(corners[i & 3], corners[(i + 1) & 3]); };
    for (int i = 0; i < 4; ++i) {
      if (!inside(i) || inside(i + 1)) continue;  // edge i leaves the inside
      int enter = i;
      if ((joined >> face) & 1u) {
        do ++enter;
        while (inside(enter) || !inside(enter + 1));
      } else {
        do --enter;
        while (inside(enter & 3) || !inside(enter + 1));
      }
      next[edge(i)] = edge(enter);
    }
  }
  std::vector<Loop> loops;
  for (int start = 0; start < 12; ++start) {
    if (next[start] < 0) continue;
    Loop loop;
    for (int at = start; next[at] >= 0;) {
      loop.push_back(at);
      const int to = next[at];
      next[at] = -1;
      at = to;
    }
    loops.push_back(loop);
  }
  return loops;
}

/// Triangles of a polygon without a diagonal inside a face of the cell, where the neighbour might have the
/// same one; for long polygons, and where there are none, a fan around the cell's own point.
void triangulate(const Loop& loop, Triples& out) {
  const auto size = static_cast<int>(loop.size());
  const auto at = [&](int i) { return static_cast<std::uint8_t>(loop[i]); };
  // cost(i, j): fewest bad diagonals in triangulations of the corners i..j (and which corner makes the last
  // one).
  std::array<std::array<int, 12>, 12> cost{}, apex{};
  for (int width = 2; width < size; ++width)
    for (int i = 0; i + width < size; ++i) {
      const int j = i + width;
      int best = 1000;
      for (int k = i + 1; k < j; ++k) {
        const auto part = [&](int a, int b) { return cost[a][b]; };
        const int all = part(i, k) + part(k, j);
        if (all < best) {
          best = all;
          apex[i][j] = k;
        }
      }
      const bool is_side = width == size - 1;  // of the polygon
      cost[i][j] = best + (!is_side && share_face(at(i), at(j)) ? 1 : 0);
    }
  if (size >= shortest_fan || cost[0][size - 1] > 0) {
    for (int i = 0; i < size; ++i) out.push_back({at((i + 1) % size), at(i), CellTable::centre});
    return;
  }
  std::vector<std::pair<int, int>> open{{0, size - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const int k = apex[i][j];
    out.push_back({at(j), at(k), at(i)});
    open.push_back({i, k});
    open.push_back({k, j});
  }
}

/// A band between two polygons and around the cell's own point: two triangles between a side of the one and a
/// side of the other where no diagonal lies in a face, and a fan over what is left.
Triples band(const Loop& first, const Loop& second) {
  Triples out;
  const Loop a(first.rbegin(), first.rend()), b(second.rbegin(), second.rend());
  const auto n = a.size(), m = b.size();
  for (std::size_t i = 0; i < n && out.empty(); ++i)
    for (std::size_t j = 0; j < m && out.empty(); ++j) {
      const int a0 = a[i], a1 = a[(i + 1) % n], b0 = b[j], b1 = b[(j + 1) % m];
      if (share_face(a1, b0) || share_face(b1, a0) || share_face(a0, b0)) continue;
      Loop rest;
      for (std::size_t k = 1; k <= n; ++k) rest.push_back(a[(i + k) % n]);
      for (std::size_t k = 1; k <= m; ++k) rest.push_back(b[(j + k) % m]);
      const auto triple = [](int x, int y, int z) {
        return std::array<std::uint8_t, 3>{static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y),
                                           static_cast<std::uint8_t>(z)};
      };
      out = {triple(a0, a1, b0), triple(a0, b0, b1)};
      for (std::size_t k = 0; k < rest.size(); ++k)
        out.push_back(triple(rest[k], rest[(k + 1) % rest.size()], CellTable::centre));
    }
  return out;
}

/// The choice of ambiguous faces as a dense number: their bits in `joined`, packed.
unsigned packed(unsigned joined, unsigned ambiguous) {
  unsigned result = 0, bit = 0;
  for (unsigned face = 0; face < 6; ++face)
    if ((ambiguous >> face) & 1u) result |= ((joined >> face) & 1u) << bit++;
  return result;
}

}  // namespace

int CellTable::edge_corner(int edge) {
  const int axis = edge / 4, u = (edge >> 1) & 1, v = edge & 1;
  return (u << (2 - (axis + 1) % 3)) | (v << (2 - (axis + 2) % 3));
}

std::array<int, 4> CellTable::face_corners(int face) {
  const int axis = face / 2, side = face & 1;
  const int base = side << (2 - axis), u = 1 << (2 - (axis + 1) % 3), v = 1 << (2 - (axis + 2) % 3);
  if (side == 1) return {base, base | u, base | u | v, base | v};
  return {base, base | v, base | u | v, base | u};
}

CellTable::CellTable() {
  for (unsigned pattern = 0; pattern < 256; ++pattern) {
    for (int face = 0; face < 6; ++face) {
      const auto c = face_corners(face);
      const auto inside = [&](std::size_t i) { return (pattern >> c[i]) & 1u; };
      if (inside(0) == inside(2) && inside(1) == inside(3) && inside(0) != inside(1))
        ambiguous_[pattern] |= 1u << face;
    }
    const unsigned faces = ambiguous_[pattern];
    for (unsigned joined = 0; joined < 64; ++joined) {
      if ((joined & ~faces) != 0) continue;
      auto& choices = triangles_[pattern];
      choices.resize(std::max<std::size_t>(choices.size(), packed(joined, faces) + 1));
      const std::vector<Loop> loops = trace(pattern, joined);
      for (const Loop& loop : loops) triangulate(loop, choices[packed(joined, faces)]);
      if (std::popcount(faces) != 1 || loops.size() != 2) continue;
      if (std::minmax({loops[0].size(), loops[1].size()}) == std::pair<std::size_t, std::size_t>(3, 4))
        tunnels_[pattern] = band(loops[0], loops[1]);
    }
  }
}

const CellTable& CellTable::get() {
  static const CellTable table;
  return table;
}

const Triples& CellTable::triangles(unsigned pattern, unsigned joined) const {
  return triangles_[pattern][packed(joined, ambiguous_[pattern])];
}

}  // namespace arapfields
