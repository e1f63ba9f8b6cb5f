// SPDX-License-Identifier: GPL-3.0-or-later
// The two sweeps through coupling layers, and the way back to where points came from, for one block of
// points; for libtorch sources alone. All ten columns of second-order jets travel through the layers: each
// layer bends what the one before it made, so that sums over the layers alone (mlp.h) would not do.
#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "core/jets.h"
#include "neural/coupling_shape.h"

namespace arapfields {

/// The weights (fan_out, fan_in) and biases (fan_out) of each coupling layer's network, and the offset (3),
/// as views into one flat vector.
struct CouplingViews {
  struct Network {
    std::vector<at::Tensor> weights, biases;
  };
  CouplingViews() = default;
  CouplingViews(const CouplingShape& shape, const at::Tensor& flat);
  std::vector<Network> networks;
  at::Tensor offset;
};

/// What one coupling layer computes for a block: the jets (columns, count, 3) that come in, its encoding
/// (columns·count, 4·octaves), the hidden layers' pre-activations and activations (columns·count, width),
/// their slopes (count, width), and the output (columns·count, 2).
struct CouplingMemory {
  at::Tensor jets, encoding, output;
  std::vector<at::Tensor> pre, activations, slope;
};

/// A block's memory: one a coupling layer where pull_back is to follow, one for all otherwise.
std::vector<CouplingMemory> coupling_memory(const CouplingShape& shape, const at::Tensor& like, Index count,
                                            int columns, bool keep);

/// Jets (columns, count, 3) at points (count, 3).
at::Tensor couple(const CouplingShape& shape, const CouplingViews& views, const at::Tensor& points,
                  JetOrder order, std::vector<CouplingMemory>& memory);
/// Adds what cotangents (columns, count, 3) of couple() ask of the parameters to `gradient`.
void couple_back(const CouplingShape& shape, const CouplingViews& views, const at::Tensor& cotangents,
                 std::vector<CouplingMemory>& memory, CouplingViews& gradient);
/// Takes points (count, 3), double and contiguous, where couple() takes them, or `back` where they come from,
/// in closed form: in double precision but for the networks, which have theirs.
void move_points(const CouplingShape& shape, const CouplingViews& views, at::Tensor points, bool back);

}  // namespace arapfields
