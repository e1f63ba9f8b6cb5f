// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/standing_out.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"
#include "sampling/oriented_points.h"

namespace arapfields {
namespace {

constexpr Index grain = 256;
/// Radius, in spacings, of the samples around a point; if there are fewer than least_near, the radius is
/// extended by the distance of the nearest one.
constexpr double around = 2.0;
constexpr Index least_near = 4;
/// Outward directions have a larger cosine with the mean of the normals, which is short at rims.
constexpr double inwards = -0.5;
/// Most iterations of Gilbert's method.
constexpr int most_steps = 40;

/// The direction from the convex hull of the points p − arms (n,3) to p, and the distance of p beyond them
/// along it, by Gilbert's method (1966). It ends early if the distance is at most `enough`.
std::pair<Vec3, double> out_of_hull(const Points& arms, double enough) {
  Index next = 0;
  arms.rowwise().squaredNorm().minCoeff(&next);
  Vec3 nearest = arms.row(next).transpose(), direction = Vec3::Zero();
  double height = 0.0;
  for (int step = 0; step < most_steps && nearest.norm() > enough; ++step) {
    const Vec3 along = nearest.normalized();
    const double beyond = (arms * along).minCoeff(&next);
    if (beyond > height) {
      height = beyond;
      direction = along;
    }
    const Vec3 change = arms.row(next).transpose() - nearest;
    const double share = -change.dot(nearest) / std::max(change.squaredNorm(), 1e-300);
    if (share <= 0.0) break;
    nearest += std::min(1.0, share) * change;
  }
  return {direction, height};
}

}  // namespace

std::vector<Index> standing_out(PointsIn points, PointsIn samples, PointsIn normals, double spacing,
                                double least, Index most, const Progress& progress) {
  const CancelScope scope(progress);
  const OrientedPoints tree(samples, Points::Zero(samples.rows(), 3));
  Points directions(points.rows(), 3);  // directions out of the hulls
  Vector heights = Vector::Zero(points.rows()), reaches(points.rows());
  parallel_for(0, points.rows(), grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 place = points.row(i).transpose();
      reaches[i] = around * spacing;
      std::vector<Index> near = tree.within(place, reaches[i]);
      if (std::ssize(near) < least_near) {
        const Index nearest = tree.nearest(points.row(i), Points::Zero(1, 3), 0.0)[0];
        reaches[i] += (samples.row(nearest) - points.row(i)).norm();
        near = tree.within(place, reaches[i]);
      }
      Points arms(std::ssize(near), 3);
      Vec3 normal = Vec3::Zero();
      for (Index k = 0; k < arms.rows(); ++k) {
        const Index sample = near[static_cast<std::size_t>(k)];
        arms.row(k) = place.transpose() - samples.row(sample);
        normal += normals.row(sample).transpose() / static_cast<double>(arms.rows());
      }
      const auto [direction, height] = out_of_hull(arms, least);
      directions.row(i) = direction.transpose();
      if (direction.dot(normal) >= inwards) heights[i] = height;
    }
  });
  std::vector<Index> order, chosen;
  for (Index i = 0; i < points.rows(); ++i)
    if (heights[i] > least) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return heights[a] > heights[b]; });
  for (const Index i : order) {
    if (std::ssize(chosen) == most) break;
    progress.check();
    const bool covered = std::any_of(chosen.begin(), chosen.end(), [&](Index k) {
      const Vec3 arm = (points.row(i) - points.row(k)).transpose();
      return directions.row(i).dot(arm) <= least && arm.squaredNorm() < reaches[i] * reaches[i];
    });
    if (!covered) chosen.push_back(i);
  }
  return chosen;
}

}  // namespace arapfields
