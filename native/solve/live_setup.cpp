// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_setup.h"

#include <algorithm>

#include "energies/rotation.h"

namespace arapfields {

std::vector<Index> random_subset(Index n, Index count, Random& random) {
  std::vector<Index> all(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) all[static_cast<std::size_t>(i)] = i;
  const Index taken = std::min(n, count);
  for (Index i = 0; i < taken; ++i)
    std::swap(all[static_cast<std::size_t>(i)], all[static_cast<std::size_t>(i + random.below(n - i))]);
  all.resize(static_cast<std::size_t>(taken));
  return all;
}

std::vector<Index> stratified(const std::vector<std::uint32_t>& list, Index count, Random& random) {
  const Index n = static_cast<Index>(list.size()), taken = std::min(n, count);
  std::vector<Index> result;
  for (Index i = 0; i < taken; ++i) {
    const Index begin = i * n / taken, end = (i + 1) * n / taken;
    result.push_back(list[static_cast<std::size_t>(begin + random.below(end - begin))]);
  }
  return result;
}

Points rows_of(PointsIn points, const std::vector<Index>& rows) {
  Points result(static_cast<Index>(rows.size()), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(static_cast<Index>(i)) = points.row(rows[i]);
  return result;
}

Alignment best_alignment(PointsIn points, PointsIn targets, const Vector& weights) {
  Alignment result;
  const double total = weights.sum();
  const Eigen::RowVector3d from = weights.transpose() * points / total;
  const Eigen::RowVector3d to = weights.transpose() * targets / total;
  const Points arms = points.rowwise() - from, wanted = targets.rowwise() - to;
  const Mat3 spread = wanted.transpose() * weights.asDiagonal() * arms;
  // Points on a line leave the turn about it open: a little of the identity keeps it small.
  result.rotation = closest_rotation(spread + (1e-6 * spread.norm() + 1e-300) * Mat3::Identity());
  result.translation = to.transpose() - result.rotation * from.transpose();
  const Points moved = (points * result.rotation.transpose()).rowwise() + result.translation.transpose();
  const double before = weights.dot((points - targets).rowwise().squaredNorm());
  if (before > 0.0) result.gain = weights.dot((moved - targets).rowwise().squaredNorm()) / before;
  return result;
}

}  // namespace arapfields
