// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "core/task.h"
#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

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
