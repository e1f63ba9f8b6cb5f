// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/types.h"
#include "options/network.h"

namespace arapfields {

/// A network R³ → R^outputs: positional encoding, `layers` hidden layers of `width` softplus units, linear
/// output. Encoding: for each coordinate c in turn, for k < octaves, the pair cos(2^k·frequency·c),
/// sin(2^k·frequency·c).
struct MlpShape : NetworkOptions {
  int outputs = 3;

  int encoded() const { return 6 * octaves; }
  int fan_in(int layer) const { return layer == 0 ? encoded() : width; }
  int fan_out(int layer) const { return layer == layers ? outputs : width; }
  bool operator==(const MlpShape&) const = default;
};

/// A network's numbers as plain matrices, for exchange with Python and files: weights[l] (fan_out, fan_in),
/// biases[l] (fan_out); the last pair is the output layer.
struct Layers {
  std::vector<RowMatrix<double>> weights;
  std::vector<Vector> biases;
};

/// The shape that the matrices describe. Throws InvalidInput naming the layer where they do not fit together,
/// do not start with 6·octaves inputs, or hold NaN or infinite numbers.
ARAPFIELDS_EXPORT MlpShape shape_of(const Layers& layers, int octaves, double frequency, double sharpness);

}  // namespace arapfields
