// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/canonical_order.h"

#include <cmath>

#include "core/decompositions.h"
#include "core/frame.h"
#include "distance/morton.h"

namespace arapfields {
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

std::vector<Index> evenly(const std::vector<std::uint32_t>& list, Index count) {
  const Index n = static_cast<Index>(list.size()), taken = std::min(n, count);
  std::vector<Index> result;
  for (Index i = 0; i < taken; ++i) result.push_back(list[(2 * i + 1) * n / (2 * taken)]);
  return result;
}

}  // namespace arapfields
