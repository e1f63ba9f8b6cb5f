// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"
#include "options/network.h"

namespace arapfields {

/// Coupling layers R³ → R³ in turns over the axes (Dinh et al. 2017, "Density Estimation using Real NVP"):
/// layer i takes the coordinate b = i mod 3 to y_b = x_b exp(s) + t and leaves the other two, u, alone. Its
/// network knows u alone and gives (s, t): positional encoding, `layers` hidden layers of `width` softplus
/// units, linear output; s is bent smoothly into (−bound, bound). An offset for all comes last.
struct CouplingShape : NetworkOptions {
  int couplings = 1;
  static constexpr double bound = 2.0;

  int fan_in(int layer) const { return layer == 0 ? 4 * octaves : width; }
  int fan_out(int layer) const { return layer == layers ? 2 : width; }
  /// Parameter counts of one coupling layer's network, and of all layers.
  Index network_size() const {
    Index size = 0;
    for (int l = 0; l <= layers; ++l) size += static_cast<Index>(fan_out(l)) * (fan_in(l) + 1);
    return size;
  }
  Index size() const { return couplings * network_size() + 3; }
  bool operator==(const CouplingShape&) const = default;
};

}  // namespace arapfields
