// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// Values at a rig's nodes taken to other points of the surface: linear where the nodes are, from those of
/// the same surface and side.
class VertexBlend {
 public:
  /// Of some points and their nearest nodes.
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
