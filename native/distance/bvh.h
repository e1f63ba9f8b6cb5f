// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/task.h"
#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// An axis-aligned box in the first three of four lanes; the last is idle.
struct PrimitiveBox {
  Eigen::Array4f low = Eigen::Array4f::Constant(3e38f);
  Eigen::Array4f high = Eigen::Array4f::Constant(-3e38f);
  void grow(const PrimitiveBox& other) {
    low = low.min(other.low);
    high = high.max(other.high);
  }
  float half_area() const {
    const Eigen::Array4f d = high - low;
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
  }
};

/// A triangle while the hierarchy is being built: its box, rounded outwards.
struct Primitive {
  PrimitiveBox box;
  std::int32_t triangle;
};

/// A range of primitives that becomes one child; `level` is its number of splits from the root.
struct PrimitiveRange {
  Index begin = 0, end = 0;
  int level = 0;
  PrimitiveBox box;
  Index size() const { return end - begin; }
};

/// Rearranges the range's primitives and returns its two parts, neither empty: the best of binned planes by
/// the surface area heuristic (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"),
/// where a part costs its area times the packets it will fill.
std::pair<PrimitiveRange, PrimitiveRange> split(std::vector<Primitive>& primitives,
                                                const PrimitiveRange& range);

/// The shape of a hierarchy: nodes with their children and boxes, in the order in which a depth-first walk
/// enters them, and which triangles each leaf holds. Disks, moments and packets are not filled in.
struct Topology {
  struct Leaf {
    Index begin;  ///< in `triangles`
    int count;
  };
  std::vector<WideNode> nodes;          ///< the root is the first
  std::vector<Leaf> leaves;             ///< child < 0 is leaf ~child
  std::vector<std::int32_t> triangles;  ///< ascending in each leaf
  std::vector<std::int32_t> subtrees;   ///< roots of disjoint subtrees, for parallel work
};

/// Depends on the mesh alone, not on the thread count. Coordinates must fit single precision.
Topology build_topology(const Points& vertices, TrianglesIn triangles, const Progress& progress = {});

}  // namespace arapfields
