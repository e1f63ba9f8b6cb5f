// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/inner_balls.h"

#include <cmath>

#include "core/parallel.h"

namespace arapfields {
namespace {

/// Cosine of two normals below which they face each other.
constexpr double facing = -0.5;
/// The same for witnesses at flat angles.
constexpr double facing_squarely = -0.9;

}  // namespace

Vector inner_radii(PointsIn points, PointsIn normals, PointsIn witnesses, PointsIn witness_normals,
                   const InnerBallRules& rules) {
  Vector radii(points.rows());
  const double steep = rules.least_cosine * rules.least_cosine, near = rules.near * rules.near;
  parallel_for(0, points.rows(), 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const Vec3 x = points.row(i), n = normals.row(i);
      double curvature = 1.0 / rules.most;  // of the ball: a larger one means a smaller ball
      for (Index j = 0; j < witnesses.rows(); ++j) {
        const double a = witnesses(j, 0) - x[0], b = witnesses(j, 1) - x[1], c = witnesses(j, 2) - x[2];
        const double square = a * a + b * b + c * c, depth = -(a * n[0] + b * n[1] + c * n[2]);
        const bool is_inside = 2.0 * depth > curvature * square, is_near = square <= near;
        if (!is_inside && !is_near) continue;  // most of them
        if (!(depth > 0.0)) continue;
        const bool is_flat = depth * depth < steep * square;
        if (is_inside && !is_flat && square > 0.0) curvature = 2.0 * depth / square;
        if (!is_near) continue;
        const Vec3 other = witness_normals.row(j);
        const double cosine = n.dot(other), plane = a * other[0] + b * other[1] + c * other[2];
        // At flat angles the mean of both planes' distances, in which the sheet's curvature cancels.
        const double gap = is_flat ? 0.5 * (plane + depth) : plane;
        if (cosine < (is_flat ? facing_squarely : facing) && gap > 0.0 && (1.0 - cosine) > curvature * gap)
          curvature = (1.0 - cosine) / gap;
      }
      radii[i] = 1.0 / curvature;
    }
  });
  return radii;
}

}  // namespace arapfields
