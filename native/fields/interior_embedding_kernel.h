// SPDX-License-Identifier: GPL-3.0-or-later
// Kernel of the embedding, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace arapfields {

constexpr int embedding_block = 16;  ///< points of a block
constexpr int embedding_row = 15;    ///< numbers of a node: place, ψ, slopes

/// A block of points (3, 16) and the nodes near it, those first that some of the points do not see.
struct EmbeddingBlock {
  const double* points;
  const double* nodes;
  const std::int32_t* near;
  std::int64_t near_count;
  std::int64_t hidden_count;
  double scale;          // 1/width²
  const double* excess;  // (hidden_count, columns, 16) jets of what is added to the squared distances
};

// Jets (columns, 3, 16) of ψ.
ARAPFIELDS_DECLARE(void embedding_jets(const EmbeddingBlock& block, int columns, double* jets))

}  // namespace arapfields
