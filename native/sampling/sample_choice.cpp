// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/sample_choice.h"

#include <algorithm>
#include <cmath>

#include "core/decompositions.h"
#include "core/frame.h"
#include "distance/morton.h"
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

namespace {

/// Radius, in radii of gyration, to which outliers are projected.
constexpr double far = 3.0;

}  // namespace

std::vector<std::uint32_t> canonical_order(PointsIn points) {
  const Index n = points.rows();
  if (n < 2 || (points.rowwise() - points.row(0)).cwiseAbs().maxCoeff() == 0.0) return morton_order(points);
  const Frame frame = Frame::balanced(points, Vector::Ones(n), {}, 1.0);
  Points placed = frame.to_cube(points);
  for (Index i = 0; i < n; ++i) placed.row(i) *= std::min(1.0, far / std::max(placed.row(i).norm(), 1e-300));
  const Mat3 axes = symmetric_eigen3(cross_moments(placed, placed)).vectors;
  placed = (placed * axes).eval();
  for (int k = 0; k < 3; ++k)  // axes are oriented by the sign of the third moment
    if (placed.col(k).array().cube().sum() < 0.0) placed.col(k) *= -1.0;
  return morton_order(placed);
}

std::vector<Index> evenly(Index size, Index count) {
  const Index taken = std::min(size, count);
  std::vector<Index> result;
  for (Index i = 0; i < taken; ++i) result.push_back((2 * i + 1) * size / (2 * taken));
  return result;
}

std::vector<Index> evenly(const std::vector<std::uint32_t>& list, Index count) {
  std::vector<Index> result = evenly(std::ssize(list), count);
  for (Index& entry : result) entry = list[static_cast<std::size_t>(entry)];
  return result;
}

}  // namespace arapfields
