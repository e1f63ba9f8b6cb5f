// SPDX-License-Identifier: GPL-3.0-or-later
// The two sweeps through coupling layers, and the way back to where points came from, for one block of
// points. A layer's network is a function of the plane: its jets by the two
// coordinates that it sees, six columns at most, travel through it, and the chain rule lifts what comes out,
// two numbers a point, to all ten columns by the coordinates at rest.
#pragma once

#include <vector>

#include "core/jets.h"
#include "neural/coupling_shape.h"
#include "tensors/tensor.h"

namespace arapfields {

/// The weights (fan_out, fan_in) and biases (fan_out) of each coupling layer's network, and the offset (3),
/// as views into one flat vector.
struct CouplingViews {
  struct Network {
    std::vector<Tensor> weights;
    std::vector<Tensor> biases;
  };
  CouplingViews() = default;
  CouplingViews(const CouplingShape& shape, const Tensor& flat);
  std::vector<Network> networks;
  Tensor offset;
};

/// What one coupling layer computes for a block: the jets (columns, count, 3) that come in, and as plane jets
/// (core/jets2d.h) of 1, 3 or 6 columns its encoding (plane·count, 4·octaves), the hidden layers'
/// pre-activations and activations (plane·count, width), their slopes (count, width), and the output
/// (plane·count, 2). What no mixed derivative of the encoding reaches stays zero.
struct CouplingMemory {
  Tensor jets;
  Tensor encoding;
  Tensor output;
  std::vector<Tensor> pre;
  std::vector<Tensor> activations;
  std::vector<Tensor> slope;
};

/// A block's memory: one a coupling layer where pull_back is to follow, one for all otherwise.
std::vector<CouplingMemory> coupling_memory(const CouplingShape& shape, const Tensor& like, Index count,
                                            int columns, bool keep);

/// Jets (columns, count, 3) at points (count, 3).
Tensor couple(const CouplingShape& shape, const CouplingViews& views, const Tensor& points, JetOrder order,
              std::vector<CouplingMemory>& memory);
/// Adds what cotangents (columns, count, 3) of couple() ask of the parameters to `gradient`.
void couple_back(const CouplingShape& shape, const CouplingViews& views, const Tensor& cotangents,
                 std::vector<CouplingMemory>& memory, CouplingViews& gradient);
/// Takes points (count, 3), double and contiguous, where couple() takes them, or `back` where they come from,
/// in closed form: in double precision but for the networks, which have theirs.
void move_points(const CouplingShape& shape, const CouplingViews& views, Tensor points, bool back);

}  // namespace arapfields
