// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/interior_embedding_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

using P = Pack<double>;
constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};

/// Sums over nodes of w p and w, with w = e^{−|x − node|²/width²} and p the plane through ψ at the node, and
/// of their derivatives in the order of jets.
template <int columns>
struct Sums {
  P weight[columns] = {};
  P value[columns][3] = {};
};

template <int columns>
inline void add_node(const double* node, const P (&d)[3], P w, double twice_scale, Sums<columns>& sums) {
  P plane[3];
  const double* slope = node + 6;
  for (int k = 0; k < 3; ++k)
    plane[k] = node[3 + k] + slope[3 * k] * d[0] + slope[3 * k + 1] * d[1] + slope[3 * k + 2] * d[2];
  sums.weight[0] += w;
  for (int k = 0; k < 3; ++k) sums.value[0][k] += w * plane[k];
  if constexpr (columns >= 4) {
    P dw[3];
    for (int i = 0; i < 3; ++i) {
      dw[i] = (-twice_scale * w) * d[i];
      sums.weight[1 + i] += dw[i];
      for (int k = 0; k < 3; ++k) sums.value[1 + i][k] += dw[i] * plane[k] + w * slope[3 * k + i];
    }
    if constexpr (columns >= 10)
      for (int c = 0; c < 6; ++c) {
        const int i = pairs[c][0], j = pairs[c][1];
        P ddw = (-twice_scale * dw[i]) * d[j];
        if (i == j) ddw -= twice_scale * w;
        sums.weight[4 + c] += ddw;
        for (int k = 0; k < 3; ++k)
          sums.value[4 + c][k] += ddw * plane[k] + dw[i] * slope[3 * k + j] + dw[j] * slope[3 * k + i];
      }
  }
}

template <int columns>
void jets_of(const EmbeddingBlock& block, double* jets) {
  for (int offset = 0; offset < embedding_block; offset += lanes<double>) {
    P x[3];
    for (int k = 0; k < 3; ++k) x[k] = load(block.points + k * embedding_block + offset);
    P nearest = broadcast(1e300);
    for (std::int64_t a = 0; a < block.near_count; ++a) {
      const double* node = block.nodes + embedding_row * block.near[a];
      const P d0 = x[0] - node[0], d1 = x[1] - node[1], d2 = x[2] - node[2];
      P square = d0 * d0 + d1 * d1 + d2 * d2;
      if (block.excess != nullptr) square += load(block.excess + embedding_block * a + offset);
      nearest = square < nearest ? square : nearest;
    }
    Sums<columns> sums;
    for (std::int64_t a = 0; a < block.near_count; ++a) {
      const double* node = block.nodes + embedding_row * block.near[a];
      const P d[3] = {x[0] - node[0], x[1] - node[1], x[2] - node[2]};
      P square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      if (block.excess != nullptr) square += load(block.excess + embedding_block * a + offset);
      add_node<columns>(node, d, exponential<double>((nearest - square) * block.scale), 2.0 * block.scale,
                        sums);
    }
    const P inverse = 1.0 / sums.weight[0];
    P out[columns][3];
    for (int k = 0; k < 3; ++k) {
      out[0][k] = sums.value[0][k] * inverse;
      if constexpr (columns >= 4)
        for (int i = 0; i < 3; ++i)
          out[1 + i][k] = (sums.value[1 + i][k] - out[0][k] * sums.weight[1 + i]) * inverse;
      if constexpr (columns >= 10)
        for (int c = 0; c < 6; ++c) {
          const int i = 1 + pairs[c][0], j = 1 + pairs[c][1];
          out[4 + c][k] = (sums.value[4 + c][k] - out[i][k] * sums.weight[j] - out[j][k] * sums.weight[i] -
                           out[0][k] * sums.weight[4 + c]) *
                          inverse;
        }
    }
    for (int c = 0; c < columns; ++c)
      for (int k = 0; k < 3; ++k) store(jets + (c * 3 + k) * embedding_block + offset, out[c][k]);
  }
}

}  // namespace

void embedding_jets(const EmbeddingBlock& block, int columns, double* jets) {
  if (columns == 1) return jets_of<1>(block, jets);
  if (columns == 4) return jets_of<4>(block, jets);
  jets_of<10>(block, jets);
}

}  // namespace arapfields::SIMD_LEVEL
