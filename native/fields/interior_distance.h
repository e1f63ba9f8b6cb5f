// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "core/types.h"

namespace arapfields {

/// Of two points, by their rows.
using MayJoin = std::function<bool(Index, Index)>;

/// A graph on samples of a surface, with edges where a path inside the shape joins them. Each node has the
/// largest ball that touches the surface there from inside and holds no other node; two nodes are joined
/// where one's ball nearly holds the other's center, or where they are neighbours on one sheet. Parts that
/// nothing joins are joined by the shortest straight lines there are.
class InteriorGraph {
 public:
  struct Edge {
    std::int32_t to;
    float length;
  };

  /// Nodes (n,3), their outward unit normals (n,3), and how far apart neighbours are; `may_join` tells of two
  /// nodes whether an edge may join them, none: always.
  InteriorGraph(PointsIn nodes, PointsIn normals, double spacing, const MayJoin& may_join = {});
  Index size() const { return static_cast<Index>(edges_.size()); }
  const std::vector<Edge>& edges(Index node) const { return edges_[node]; }
  /// Lengths (n, sources) of the shortest paths from the first `sources` nodes.
  RowMatrix<double> distances(Index sources) const;
  /// Lengths (n) of the shortest paths that begin at any node with that node's length; infinity: not there.
  std::vector<float> distances_from(std::vector<float> start) const;

 private:
  void join_parts(PointsIn nodes);
  std::vector<std::vector<Edge>> edges_;
};

}  // namespace arapfields
