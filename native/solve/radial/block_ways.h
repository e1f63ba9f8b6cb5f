// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "fields/radial_evaluator.h"

namespace arapfields {

/// What may have come near what a surface meets, of the blocks of a RadialEvaluator of its places, since
/// these were looked at: one place of each is followed all the time, and the others are not far from it.
class ARAPFIELDS_EXPORT_TO_TESTS BlockWays {
 public:
  static constexpr Index block_size = RadialEvaluator<float>::block_size;

  BlockWays() = default;
  /// Of places at rest, with their embedding if that is not empty. Nothing was looked at.
  BlockWays(const RadialBasis& basis, PointsIn rest, PointsIn embedded);
  Index count() const { return free_.size(); }
  /// Where coefficients take the places that are followed.
  void move_to(const RowMatrix<double>& coefficients);
  /// That a block is at these places now, and not nearer to anything than `way`.
  void see(Index block, PointsIn places);
  void set_free(Index block, double way) { free_[block] = way; }
  /// All that the blocks may meet has come nearer by so much at most.
  void narrow(double way) { free_.array() -= way; }
  /// Whether a block was not looked at for long, or may be nearer to anything than `reach` now; `ahead`:
  /// after one more way as long as the last.
  bool may_be_near(Index block, double reach, bool ahead) const;
  /// How far the place of a block that is followed moved last.
  double last_way(Index block) const { return (now_.row(block) - before_.row(block)).norm(); }

 private:
  std::vector<Index> rows_;  // that are followed
  RadialEvaluator<float> evaluator_;
  Points now_;
  Points before_;
  Points seen_;     // where they were when their blocks were looked at
  Vector widths_;   // how far others may be from them, as those were then or at rest
  Vector at_rest_;  // likewise, along the inside
  Vector free_;
  Index moves_ = 0;
};

}  // namespace arapfields
