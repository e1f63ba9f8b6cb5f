// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// A grid cell's corner values (in CellTable's order) and how the surface passes it.
struct Cell {
  /// Distance of vertices from grid points, in edges: where Φ is exactly zero on one, several edges meet in
  /// it and the triangles between them would vanish.
  static constexpr double clearance = 1e-6;

  float corner[8];
  unsigned pattern = 0;
  bool complete = true;  ///< all corners are grid points, not NaN

  /// value(i, j, k) for i, j, k in {0, 1}
  template <class Value>
  explicit Cell(Value&& value) {
    for (unsigned c = 0; c < 8; ++c) {
      corner[c] = value(static_cast<int>(c >> 2), static_cast<int>((c >> 1) & 1), static_cast<int>(c & 1));
      complete = complete && !(corner[c] != corner[c]);
      pattern |= (corner[c] < 0.0f ? 1u : 0u) << c;
    }
  }
  bool crossed() const { return complete && pattern != 0 && pattern != 255; }
  /// Those of CellTable. On ambiguous faces the bilinear interpolant's saddle decides, between a corner and a
  /// pair of corners the trilinear interpolant.
  const std::vector<std::array<std::uint8_t, 3>>& triangles() const;

  /// The mean of the corners' positions (position(c) for c = 0..7), weighted by 1/|value|.
  template <class Position>
  Vec3 centre(Position&& position) const {
    double largest = 0.0, sum = 0.0;
    for (const float value : corner) largest = std::max<double>(largest, std::abs(value));
    Vec3 mean = Vec3::Zero();
    for (int c = 0; c < 8; ++c) {
      const double weight = 1.0 / std::max<double>(std::abs(corner[c]), clearance * largest);
      mean += weight * position(c);
      sum += weight;
    }
    return mean / sum;
  }
  /// Whether the negative ones of a face's corners, which alternate, are joined on it; the order is any.
  static bool joined(const std::array<float, 4>& corners);
};

}  // namespace arapfields
