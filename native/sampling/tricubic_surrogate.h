// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "sampling/evaluation_counter.h"
#include "sampling/lines.h"

namespace arapfields {

/// Lagrange weights of the nodes 0, 1, 2, 3 at u.
inline void cubic_weights(float u, float (&w)[4]) {
  const float a = u, b = u - 1.0f, c = u - 2.0f, d = u - 3.0f;
  w[0] = b * c * d * (-1.0f / 6.0f);
  w[1] = a * c * d * 0.5f;
  w[2] = a * b * d * -0.5f;
  w[3] = a * b * c * (1.0f / 6.0f);
}

/// The values of a 4×4×4 block of grid points, z fastest, and their cubic interpolation at (u, v, w) in
/// [0,3]³.
struct CubicBlock {
  float node[64];

  float operator()(float u, float v, float w) const {
    float wu[4], wv[4], ww[4], line[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    cubic_weights(u, wu);
    cubic_weights(v, wv);
    cubic_weights(w, ww);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const float weight = wu[i] * wv[j];
        for (int k = 0; k < 4; ++k) line[k] += weight * node[16 * i + 4 * j + k];
      }
    return line[0] * ww[0] + line[1] * ww[1] + line[2] * ww[2] + line[3] * ww[3];
  }
};

struct TricubicSurrogateOptions {
  Index target_cells = 5000;   ///< cells are halved until so many may contain the surface …
  int max_cells_a_side = 128;  ///< … or the cube would have more than so many cells a side
  int coarsest = 16;           ///< cells a side at the start
  bool interpolate = true;     ///< false: only the signs of cells are computed, not p and its errors
};

/// A cheap surrogate p of Φ near {Φ = 0}. The cube is divided into resolution³ cells, from coarse to fine; a
/// cell is culled if |Φ(centre)| exceeds a bound on |∇Φ| times its half diagonal, since Φ then has one sign
/// there. In the remaining cells p is the tricubic interpolant of Φ at their corners and the corners around
/// them, with an error bound measured by Φ − p at cell centres. Sampling and extraction use p to find where Φ
/// itself must be evaluated.
class TricubicSurrogate {
 public:
  TricubicSurrogate(EvaluationCounter& function, const TricubicSurrogateOptions& options);

  int cells_a_side() const { return cells_a_side_; }
  double spacing() const { return 2.0 / cells_a_side_; }
  bool interpolates() const { return !values_.empty(); }
  /// Bound on |∇Φ| in use: Φ's own, else measured, and raised until no difference of grid values contradicts
  /// it.
  double lipschitz() const { return lipschitz_; }
  /// Cells that may contain the surface, ascending; their bounding box (undefined for none).
  const std::vector<Index>& active() const { return active_; }
  /// Whether Φ has both signs in other cells.
  bool has_both_sides() const;
  Box bounds() const;

  Index cell(int i, int j, int k) const {
    return (static_cast<Index>(i) * cells_a_side_ + j) * cells_a_side_ + k;
  }
  std::array<int, 3> coordinates(Index cell) const;
  /// The cell's position along an axis of a coordinate in [-1,1].
  int position(double x) const;
  /// +1 or −1 where Φ keeps that sign in all of the cell, 0 in the cells of active().
  int side(Index cell) const { return side_[cell]; }
  /// Bounds in an active cell on |Φ − p| and on |∇(Φ − p)|.
  float error(Index cell) const { return error_[cell]; }
  float slope_error(Index cell) const { return slope_error_of(error(cell)); }
  /// The latter from the former.
  float slope_error_of(float error) const;

  /// The sign of Φ at a point of an active cell, as far as Φ at its centre and corners and the bound on |∇Φ|
  /// determine it; 0: either.
  int settled_sign(Index cell, const Vec3& point) const;

  /// p's coefficients in an active cell; at(block, …) evaluates them at a point of the cube.
  CubicBlock block(Index cell) const;
  /// First grid point of a cell's 4×4×4 block along an axis; p takes (x + 1) / spacing − that.
  int block_start(int position) const;
  /// p at a point in an active cell.
  float operator()(const Vec3& point) const;

 private:
  void cull(EvaluationCounter& function, const TricubicSurrogateOptions& options);
  bool fill(EvaluationCounter& function);
  void measure_errors();

  int cells_a_side_ = 0;
  double lipschitz_ = 0.0;
  double coarse_slope_ = 0.0;  // largest between centres of the coarsest cells
  std::vector<std::int8_t> side_;
  std::vector<Index> active_;
  VectorF centre_values_;      // of active_
  std::vector<float> centre_;  // the same, resolution³
  std::vector<float> error_;   // resolution³
  std::vector<float> values_;  // (resolution+1)³ grid points; NaN: not computed
};

}  // namespace arapfields
