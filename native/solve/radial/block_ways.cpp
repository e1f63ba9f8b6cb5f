// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/block_ways.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Places of a block come no nearer to anything, beside the way of the one that is followed, than so many
/// times its width when it was looked at: it may turn over, and stretch to twice its length.
constexpr double widths = 3.0;
/// Each block is looked at again after so many moves.
constexpr Index most_moves = 32;

double largest_distance(const RowMatrix<double>& rows, Index from) {
  return std::sqrt((rows.rowwise() - rows.row(from)).rowwise().squaredNorm().maxCoeff());
}

}  // namespace

BlockWays::BlockWays(const RadialBasis& basis, PointsIn rest, PointsIn embedded) {
  const Index blocks = (rest.rows() + block_size - 1) / block_size;
  at_rest_.resize(blocks);
  for (Index b = 0; b < blocks; ++b) {
    const Index first = block_size * b, count = std::min(block_size, rest.rows() - first);
    RowMatrix<double> within = RowMatrix<double>::Zero(count, 6);
    within.leftCols(3) = rest.middleRows(first, count);
    if (embedded.rows() > 0) within.rightCols(3) = embedded.middleRows(first, count);
    const RowMatrix<double> middle = 0.5 * (within.colwise().minCoeff() + within.colwise().maxCoeff());
    Index nearest = 0;
    (within.rowwise() - middle.row(0)).rowwise().squaredNorm().minCoeff(&nearest);
    rows_.push_back(first + nearest);
    at_rest_[b] = largest_distance(within, nearest);
  }
  const Points of_rows = embedded.rows() > 0 ? rows_of(embedded, rows_) : Points(0, 3);
  evaluator_ = RadialEvaluator<float>(basis, rows_of(rest, rows_), JetOrder::value,
                                      of_rows.rows() > 0 ? &of_rows : nullptr);
  now_ = before_ = seen_ = Points::Zero(blocks, 3);
  widths_ = at_rest_;
  free_ = Vector::Constant(blocks, -std::numeric_limits<double>::infinity());
}

void BlockWays::move_to(const RowMatrix<double>& coefficients) {
  PointsF places(count(), 3);
  evaluator_.evaluate(coefficients, {places.data(), count(), JetOrder::value});
  before_ = std::exchange(now_, places.cast<double>());
  ++moves_;
}

void BlockWays::see(Index block, PointsIn places) {
  seen_.row(block) = now_.row(block);
  widths_[block] = std::max(at_rest_[block],
                            largest_distance(places, rows_[static_cast<std::size_t>(block)] % block_size));
}

bool BlockWays::may_be_near(Index block, double reach, bool ahead) const {
  if ((block + moves_) % most_moves == 0) return true;
  const double left = free_[block] - (now_.row(block) - seen_.row(block)).norm() - widths * widths_[block];
  return left < reach + (ahead ? last_way(block) : 0.0);
}

}  // namespace arapfields
