// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/jets.h"

namespace arapfields {

/// The product rule: p becomes the jet of a·p, up to second derivatives. a(c) and p(c) are the columns of the
/// factor's jet and of one component.
template <class Factor, class Component>
void multiply_jet(const Factor& a, const Component& p) {
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const int cj = first_column(j), ck = first_column(k), cjk = second_column(j, k);
      p(cjk) = a(0) * p(cjk) + a(cj) * p(ck) + a(ck) * p(cj) + a(cjk) * p(0);
    }
  for (int c = 1; c < 4; ++c) p(c) = a(0) * p(c) + a(c) * p(0);
  p(0) *= a(0);
}

}  // namespace arapfields
