// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/mirror.h"

#include <algorithm>
#include <cmath>

namespace arapfields {
namespace {

/// Distance from the plane, as a fraction of its radius, within which a center is projected onto it: twins
/// closer than that would be nearly dependent.
constexpr double nearly_on_plane = 0.08;
/// Number of centers on one side, relative to that of a field without symmetry, for an energy within one
/// percent of its.
constexpr double half = 0.9;

}  // namespace

Points Mirror::reflected(PointsIn points) const {
  Points result = points;
  result.col(axis) *= -1.0;
  return result;
}

void Mirror::symmetrise(RowMatrix<double>& c) const {
  const Index count = static_cast<Index>(twins.size());
  for (Index m = 0; m < count; ++m) {
    const Index twin = twins[m];
    if (twin < m) continue;
    for (int k = 0; k < 3; ++k) {
      const double sign = k == axis ? -1.0 : 1.0;
      const double mean = 0.5 * (c(m, k) + sign * c(twin, k));
      c(m, k) = mean;
      c(twin, k) = sign * mean;
    }
  }
  c(count, axis) = 0.0;
  for (int k = 0; k < 3; ++k)
    if (k != axis) c(count + 1 + k, axis) = c(count + 1 + axis, k) = 0.0;
}

RowMatrix<double> Mirror::reflected_rows(const RowMatrix<double>& rows) const {
  RowMatrix<double> result = rows;
  for (std::size_t m = 0; m < twins.size(); ++m) result.col(m) = rows.col(twins[m]);
  result.col(static_cast<Index>(twins.size()) + 1 + axis) *= -1.0;
  return result;
}

void Mirror::symmetrise_matrix(RowMatrix<double>& lower) const {
  const Index count = static_cast<Index>(twins.size()), size = lower.rows();
  const auto twin = [&](Index i) { return i < count ? twins[i] : i; };
  const auto sign = [&](Index i) { return i == count + 1 + axis ? -1.0 : 1.0; };
  const RowMatrix<double> before = lower;
  for (Index i = 0; i < size; ++i)
    for (Index j = 0; j <= i; ++j) {
      const Index a = twin(i), b = twin(j);
      lower(i, j) = 0.5 * (before(i, j) + sign(i) * sign(j) * before(std::max(a, b), std::min(a, b)));
    }
}

FoldedPoints folded(PointsIn points, PointsIn normals, const RadialLayout& layout, int axis) {
  FoldedPoints result{points, normals, layout};
  for (Index i = 0; i < points.rows(); ++i) {
    if (points(i, axis) >= 0.0) continue;
    result.points(i, axis) *= -1.0;
    if (result.normals.rows() > 0) result.normals(i, axis) *= -1.0;
    if (result.layout.inner.rows() > 0) result.layout.inner(i, axis) *= -1.0;
  }
  if (result.layout.inner.rows() > 0)
    result.layout.inner.col(axis) = result.layout.inner.col(axis).cwiseAbs().eval();
  return result;
}

RadialBasis mirrored_basis(const FoldedPoints& side, const std::vector<RadialScale>& scales, Mirror& mirror) {
  std::vector<RadialScale> fewer = scales;
  for (RadialScale& scale : fewer)
    scale.count = std::max<Index>(1, static_cast<Index>(std::ceil(half * static_cast<double>(scale.count))));
  const RadialBasis one = radial_basis(side.points, fewer, side.layout);
  RadialBasis both{Points(2 * one.center_count(), 3), Vector(2 * one.center_count()), nullptr, {}};
  Index count = 0;
  mirror.twins.clear();
  for (Index m = 0; m < one.center_count(); ++m) {
    const bool on_plane = one.centers(m, mirror.axis) < nearly_on_plane * one.radii[m];
    for (int k = 0; k < (on_plane ? 1 : 2); ++k) {
      both.centers.row(count + k) = one.centers.row(m);
      both.centers(count + k, mirror.axis) =
          on_plane ? 0.0 : (k == 0 ? 1.0 : -1.0) * one.centers(m, mirror.axis);
      both.radii[count + k] = one.radii[m];
      mirror.twins.push_back(on_plane ? count : count + 1 - k);
    }
    count += on_plane ? 1 : 2;
  }
  both.centers.conservativeResize(count, 3);
  both.radii.conservativeResize(count);
  return both;
}

}  // namespace arapfields
