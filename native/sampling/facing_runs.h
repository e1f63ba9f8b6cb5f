// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "core/export.h"
#include "core/types.h"

namespace arapfields {

/// A broad phase for self-contact: runs of samples that are compact at rest, in a hierarchy of four children
/// a node, and the search for pairs of runs whose samples face each other in a deformed shape.
class ARAPFIELDS_EXPORT_TO_TESTS FacingRuns {
 public:
  static constexpr Index run = 4;
  /// For rest coordinates of samples (n,8). Pairs whose rows have a distance below `far` are excluded.
  FacingRuns(RowMatrix<double> rest, double far);
  Index count() const { return (std::ssize(order_) + run - 1) / run; }
  std::span<const Index> samples(Index k) const {
    return std::span(order_).subspan(static_cast<std::size_t>(k * run),
                                     static_cast<std::size_t>(std::min(run, std::ssize(order_) - k * run)));
  }
  /// For each run the runs with a sample within `near` of one of its own, at places (n,3), with the cosine of
  /// their normals at most `facing`. `normals` (n,3) of length 1; empty: any. Only `open` samples count.
  std::vector<std::vector<Index>> meeting(PointsIn places, const Points& normals,
                                          const Eigen::Array<bool, Eigen::Dynamic, 1>& open, double near,
                                          double facing) const;

 private:
  using Lanes = Eigen::Array<float, 4, 1>;  // one for each sample of a run, or each child of a node
  struct Rest {
    Lanes at[8];
  };
  struct Now {
    Lanes at[3];
    Lanes normal[3];
  };
  struct Balls {
    Lanes middle[8];
    Lanes left;  // half of `far` minus the radius
  };
  struct Boxes {
    Lanes low[3];
    Lanes high[3];
  };
  struct Limits {
    float near;  // squared
    float facing;
    float far;  // squared
  };
  static bool meet(const Rest& rest_a, const Rest& rest_b, const Now& a, const Now& b, const Limits& limits);
  static Balls balls_of(const RowMatrix<double>& rest, Index parent, Index rows, double far);
  std::vector<std::vector<Boxes>> boxes_of(const std::vector<Now>& now) const;

  std::vector<Index> order_;               // spatial order of the samples at rest
  std::vector<std::vector<Balls>> balls_;  // at rest, of each level's nodes, from those above the runs up
  std::vector<Rest> rest_;
  float far_;
};

}  // namespace arapfields
