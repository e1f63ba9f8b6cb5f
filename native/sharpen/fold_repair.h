// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "sharpen/contact_limits.h"
#include "sharpen/welded_surface.h"

namespace arapfields {

/// Opens the triangles of a moved surface that are folded, by moving few nodes: those of tiny triangles as
/// one body, then one node of a triangle at a time, then what lies around, in more and more rings, by the
/// local and global steps of as-rigid-as-possible deformation.
class FoldRepair {
 public:
  /// `start` (k,3): the shape before; `held` (k): 1 for nodes that stay. All must outlive it.
  FoldRepair(const WeldedSurface& surface, const Points& start, const std::vector<char>& held,
             const ContactLimits& limits, const Progress& progress);

  /// Opens what is folded at these positions (k,3). Returns whether no triangle is left that is folded, but
  /// for those that are at the start.
  bool open_folds(Points& positions);
  /// Those that are left, in ascending order.
  const std::vector<std::int32_t>& folded() const { return folded_; }

 private:
  using Nodes = std::vector<std::int32_t>;

  /// One round: `move` gets each triangle that is folded and returns the nodes that it has moved.
  template <class Move>
  void round(Move&& move);
  const Points& shape_of(Index triangle) const;
  void look_again(const Nodes& moved);
  Nodes nodes_around(Index triangle, int rings) const;
  Nodes close_nodes(Index triangle) const;
  Mat3 turn_of(const Nodes& nodes, const Points& shape) const;
  Nodes move_as_one(Index triangle);
  Nodes open(Index triangle);
  Nodes relax(Index triangle, int rings);

  const WeldedSurface& surface_;
  const Points& start_;
  const std::vector<char>& held_;
  const ContactLimits& limits_;
  const Progress& progress_;
  Points positions_;
  std::vector<Mat3> rotations_;
  std::vector<std::int32_t> folded_;  // triangles, in ascending order
};

}  // namespace arapfields
