// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/cell.h"

#include <algorithm>
#include <bit>

#include "extraction/cell_table.h"

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

}  // namespace arapfields
