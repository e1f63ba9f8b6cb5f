// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/surface_normals.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/unit_rows.h"

namespace arapfields {
namespace {

constexpr Index probes = 64;                            // points that determine the step
constexpr double least_step = 4e-3, most_step = 0.128;  // in cube units; each is twice the one before
// Cosines of 15 and 5 degrees: bounds on the median angle for gradients to be trusted and steps to agree.
constexpr double trusted = 0.9659, settled = 0.9962;

double median_cosine(const Points& a, const Points& b) {
  Vector cosines = a.cwiseProduct(b).rowwise().sum();
  const auto middle = cosines.begin() + cosines.size() / 2;
  std::nth_element(cosines.begin(), middle, cosines.end());
  return *middle;
}

}  // namespace

/// Unit vectors of central differences, at points clamped to the cube.
Points SurfaceNormals::differences(const PointsF& points, double step) {
  const Index n = points.rows();
  PointsF shifted = points.replicate(6, 1);
  for (int axis = 0; axis < 3; ++axis) {
    auto ahead = shifted.col(axis).segment(2 * axis * n, n),
         behind = shifted.col(axis).segment((2 * axis + 1) * n, n);
    ahead = (ahead.array() + static_cast<float>(step)).min(1.0f).max(points.col(axis).array());
    behind = (behind.array() - static_cast<float>(step)).max(-1.0f).min(points.col(axis).array());
  }
  const VectorF values = function_.values(shifted);
  Points result(n, 3);
  for (int axis = 0; axis < 3; ++axis) {
    const Index ahead = 2 * axis * n, behind = ahead + n;
    result.col(axis) =
        (values.segment(ahead, n) - values.segment(behind, n)).cast<double>().array() /
        (shifted.col(axis).segment(ahead, n) - shifted.col(axis).segment(behind, n)).cast<double>().array();
  }
  return unit_rows(result);
}

void SurfaceNormals::choose_step(const PointsF& points, const Points& gradients) {
  const Index taken = std::min<Index>(points.rows(), probes);
  const PointsF some = points.topRows(taken);
  Points finer = gradients.topRows(taken);
  double wanted = trusted, best = -1.0, of_finer = 0.0;
  for (double step = least_step; step <= most_step; step *= 2.0) {
    const Points wider = differences(some, step);
    const double agreement = median_cosine(finer, wider);
    if (agreement > best) best = agreement, step_ = of_finer;
    if (agreement >= wanted) return;
    wanted = settled, of_finer = step, finer = wider;
  }
}

Points SurfaceNormals::operator()(const PointsF& points, const PointsF& gradients) {
  Points normals = unit_rows(gradients.cast<double>());
  if (points.rows() == 0) return normals;
  if (!chosen_) choose_step(points, normals);
  chosen_ = true;
  if (step_ > 0.0) normals = differences(points, step_);
  for (double step = std::max(least_step, 2.0 * step_); step <= 2.0 * most_step; step *= 2.0) {
    std::vector<Index> flat;
    for (Index i = 0; i < normals.rows(); ++i)
      if (!(normals.row(i).squaredNorm() > 0.0)) flat.push_back(i);
    if (flat.empty()) break;
    normals(flat, Eigen::all) = differences(points(flat, Eigen::all), step);
  }
  return normals;
}

}  // namespace arapfields
