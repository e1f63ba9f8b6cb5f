// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "core/export.h"
#include "sampling/row_boxes.h"

namespace arapfields {

/// Runs of samples that are compact at rest, and which of them meet elsewhere.
class ARAPFIELDS_EXPORT_TO_TESTS FacingRuns {
 public:
  static constexpr Index run = RowBoxes<4>::run;
  /// For coordinates of samples at rest (n,8). Those whose rows differ by less than `far` do not meet.
  FacingRuns(RowMatrix<double> rest, double far);
  Index count() const { return (std::ssize(order_) + run - 1) / run; }
  std::span<const Index> samples(Index k) const {
    return std::span(order_).subspan(static_cast<std::size_t>(k * run),
                                     static_cast<std::size_t>(std::min(run, std::ssize(order_) - k * run)));
  }
  /// For each run those with a sample that meets one of its own: within `near` of it at places (n,3), with
  /// normals whose cosine is at most `facing`. `normals` (n,3) of length 1, or empty: all do. Samples that
  /// are not `open` meet nothing.
  std::vector<std::vector<Index>> meeting(PointsIn places, const Points& normals,
                                          const Eigen::Array<bool, Eigen::Dynamic, 1>& open, double near,
                                          double facing) const;

 private:
  using Lanes = Eigen::Array<float, run, 1>;  // one for each sample of a run
  struct Rest {
    Lanes at[8];
  };
  struct Now {
    Lanes at[3];
    Lanes normal[3];
  };
  struct Ball {
    Eigen::Array<float, 8, 1> middle;
    float left;  // what its radius leaves of half the distance that is far
  };
  struct Limits {
    float near;  // of squares
    float facing;
    float far;  // of squares
  };
  static bool meet(const Rest& rest_a, const Rest& rest_b, const Now& a, const Now& b, const Limits& limits);

  std::vector<Index> order_;              // of samples, as they lie together at rest
  std::vector<std::vector<Ball>> balls_;  // at rest, for each level of boxes
  std::vector<Rest> rest_;
  float far_;
};

}  // namespace arapfields
