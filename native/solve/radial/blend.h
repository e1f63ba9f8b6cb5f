// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fields/handle_blend.h"

namespace arapfields {

/// Exact handles around a radial field r at the samples of a live solve: f = h + a (r − identity), with the
/// handles' blended motion h and the free weight a (fields/handle_blend.h). Affine in r; the constant part
/// depends on the targets. Stores samples in handle boxes and margins alone; empty: f = r.
template <class Scalar>
class RadialBlend {
 public:
  RadialBlend() = default;
  RadialBlend(const HandleBlend& blend, PointsIn samples);
  bool empty() const { return rows_.empty(); }
  /// Jets of a r from those of r.
  void multiply(JetView<Scalar> jets) const;
  /// Cotangents of r's jets from those of a r.
  void multiply_transposed(JetView<Scalar> cotangents) const;
  /// Adds the jets of h − a·identity.
  void add_fixed(JetView<Scalar> jets) const;

 private:
  std::vector<Index> rows_;    // samples with a < 1
  std::vector<Scalar> free_;   // (rows, 10) jets of a
  std::vector<Scalar> fixed_;  // (rows, 10, 3) jets of h − a·identity
};

}  // namespace arapfields
