// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/sample_choice.h"

#include <algorithm>

#include "sampling/nearest_sample.h"

namespace arapfields {
namespace {

/// Largest distance to the nearest chosen point, in means of these distances: random choices on one surface
/// leave no larger gaps.
constexpr double widest_gap = 6.0;

}  // namespace

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

std::vector<Index> missed_rows(PointsIn points, const std::vector<Index>& chosen) {
  std::vector<Index> missed;
  const auto left = points.rows() - static_cast<Index>(chosen.size());
  if (left <= 0 || chosen.empty()) return missed;
  const Vector distances = nearest_distances(rows_of(points, chosen), points);
  const double widest = widest_gap * distances.sum() / static_cast<double>(left);
  for (Index i = 0; i < distances.size(); ++i)
    if (distances[i] > widest) missed.push_back(i);
  return missed;
}

Points rows_of(PointsIn points, const std::vector<Index>& rows) {
  Points result(static_cast<Index>(rows.size()), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(static_cast<Index>(i)) = points.row(rows[i]);
  return result;
}

Vector entries_of(const Vector& numbers, const std::vector<Index>& rows) {
  Vector result(static_cast<Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) result[static_cast<Index>(i)] = numbers[rows[i]];
  return result;
}

}  // namespace arapfields
