// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <utility>
#include <vector>

#include "core/types.h"
#include "sampling/parts.h"

namespace arapfields {

/// A graph on samples of a surface, whose shortest paths approximate distances through the inside of the
/// shape. Each node has the largest ball that touches the surface there from inside and contains no other
/// node (its centre approximates the medial axis); two nodes are joined if one's ball nearly contains the
/// other's centre, or if they are neighbours on one sheet, or on both sides of a part thinner than the
/// spacing. Connected components are joined by a minimum spanning tree.
class InteriorGraph {
 public:
  struct Edge {
    std::int32_t to;
    float length;
  };

  /// Nodes (n,3), their outward unit normals (n,3), and the spacing of neighbours; `may_join`: whether an
  /// edge may join two nodes; none: always.
  InteriorGraph(PointsIn nodes, PointsIn normals, double spacing, const MayJoin& may_join = {});
  Index size() const { return static_cast<Index>(edges_.size()); }
  const std::vector<Edge>& edges(Index node) const { return edges_[node]; }
  /// Lengths (n, sources) of the shortest paths from the first `sources` nodes.
  RowMatrix<double> distances(Index sources) const;
  /// Multi-source shortest paths: lengths (n), given the initial length (n) of each source; infinity: none,
  /// or none of at most `longest`.
  std::vector<float> distances_from(std::vector<float> start,
                                    float longest = std::numeric_limits<float>::infinity()) const;

 private:
  void join_parts(PointsIn nodes, const MayJoin& may_join);
  std::vector<std::vector<Edge>> edges_;
};

}  // namespace arapfields
