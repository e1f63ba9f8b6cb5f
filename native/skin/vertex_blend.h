// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// Interpolates values at a rig's nodes to other points by moving least squares of first order, from nodes of
/// the same surface and side.
class VertexBlend {
 public:
  /// For these points and their nearest nodes.
  VertexBlend(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& nearest);

  /// Values (nodes, k) at the points (n, k).
  RowMatrix<float> operator()(const RowMatrix<float>& values) const;

 private:
  struct Entry {
    Index node;
    float weight;
  };
  std::vector<std::vector<Entry>> entries_;
};

}  // namespace arapfields
