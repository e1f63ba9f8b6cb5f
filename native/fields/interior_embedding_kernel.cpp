// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/interior_embedding_kernel.h"

#include "core/pack_exp.h"

namespace arapfields::SIMD_LEVEL {
namespace {

using P = Pack<double>;
constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};

/// Sums over nodes of w p and w, with w = e^{−q/width²}, q = |x − node|² + the node's excess, and p the plane
/// through ψ at the node, and of their derivatives in the order of jets.
template <int columns>
struct Sums {
  P weight[columns] = {};
  P value[columns][3] = {};
};

/// `excess`: jets of the node's excess, if `hidden`.
template <int columns, bool hidden>
inline void add_node(const double* node, const double* excess, const P (&d)[3], P w, double scale,
                     Sums<columns>& sums) {
  P plane[3];
  const double* slope = node + 6;
  for (int k = 0; k < 3; ++k)
    plane[k] = node[3 + k] + slope[3 * k] * d[0] + slope[3 * k + 1] * d[1] + slope[3 * k + 2] * d[2];
  sums.weight[0] += w;
  for (int k = 0; k < 3; ++k) sums.value[0][k] += w * plane[k];
  if constexpr (columns >= 4) {
    P dq[3], dw[3];
    for (int i = 0; i < 3; ++i) {
      dq[i] = 2.0 * d[i];
      if constexpr (hidden) dq[i] += load(excess + embedding_block * (1 + i));
      dw[i] = (-scale * w) * dq[i];
      sums.weight[1 + i] += dw[i];
      for (int k = 0; k < 3; ++k) sums.value[1 + i][k] += dw[i] * plane[k] + w * slope[3 * k + i];
    }
    if constexpr (columns >= 10)
      for (int c = 0; c < 6; ++c) {
        const int i = pairs[c][0], j = pairs[c][1];
        P ddw = (-scale * dw[i]) * dq[j];
        if (i == j) ddw -= (2.0 * scale) * w;
        if constexpr (hidden) ddw -= (scale * w) * load(excess + embedding_block * (4 + c));
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
    const auto node_of = [&](std::int64_t a) { return block.nodes + embedding_row * block.near[a]; };
    const auto excess_of = [&](std::int64_t a) {
      return block.excess + embedding_block * columns * a + offset;
    };
    const auto square_of = [&](std::int64_t a, P(&d)[3]) {
      for (int k = 0; k < 3; ++k) d[k] = x[k] - node_of(a)[k];
      const P square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      return a < block.hidden_count ? square + load(excess_of(a)) : square;
    };
    P d[3];
    P nearest = broadcast(1e300);
    for (std::int64_t a = 0; a < block.near_count; ++a) {
      const P square = square_of(a, d);
      nearest = square < nearest ? square : nearest;
    }
    Sums<columns> sums;
    for (std::int64_t a = 0; a < block.near_count; ++a) {
      const P square = square_of(a, d);
      const P w = exponential<double>((nearest - square) * block.scale);
      if (a < block.hidden_count)
        add_node<columns, true>(node_of(a), excess_of(a), d, w, block.scale, sums);
      else
        add_node<columns, false>(node_of(a), nullptr, d, w, block.scale, sums);
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
