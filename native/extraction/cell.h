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

/// How the surface passes a grid cell, for every sign pattern of its corners.
///
/// Corner c lies at ((c >> 2) & 1, (c >> 1) & 1, c & 1). Edge e = 4·axis + 2·u + v runs along `axis`; u and v
/// are its coordinates along the next two axes, cyclically. Face f = 2·axis + side. A pattern has bit c set
/// where corner c is inside (negative). On a face whose corners alternate, the inside corners may be joined
/// or separate: bit f of `joined` says which, and both cells at the face must say the same.
struct CellTable {
  /// Edge triples, counter-clockwise seen from outside; edge 12 means the cell's own additional point.
  const std::vector<std::array<std::uint8_t, 3>>& triangles(unsigned pattern, unsigned joined) const;
  /// For patterns with one ambiguous face, on which a single corner meets the end of a pair of corners, both
  /// of the other sign than the cell's remaining five: the triangles where single and pair are separate on
  /// the face but connected through the cell. Empty for all other patterns.
  const std::vector<std::array<std::uint8_t, 3>>& tunnel(unsigned pattern) const { return tunnels_[pattern]; }
  /// Faces of a pattern whose corners alternate, as bits.
  unsigned ambiguous(unsigned pattern) const { return ambiguous_[pattern]; }

  static const CellTable& get();

  static constexpr int centre = 12;
  static int edge_axis(int edge) { return edge / 4; }
  /// The end of the edge with the smaller coordinate; the other end is a step along edge_axis().
  static int edge_corner(int edge);
  static int corner_at(int corner, int axis) { return (corner >> (2 - axis)) & 1; }
  /// Corners of a face in cyclic order, counter-clockwise seen from outside the cell.
  static std::array<int, 4> face_corners(int face);

 private:
  CellTable();
  using Triples = std::vector<std::array<std::uint8_t, 3>>;
  std::array<unsigned, 256> ambiguous_{};
  std::array<Triples, 256> tunnels_;
  std::array<std::vector<Triples>, 256> triangles_;  // one entry for each choice of its ambiguous faces
};

}  // namespace arapfields
