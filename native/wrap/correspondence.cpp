// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/correspondence.h"

#include <algorithm>
#include <cmath>

#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

/// Differences of curvature above curvature_outlier standard deviations are outliers; the standard deviation
/// is estimated as deviation_of_median times the median of absolute differences.
constexpr double curvature_outlier = 2.0, deviation_of_median = 1.48;

/// Weight of a pair by its normals (Rusinkiewicz, Levoy 2001, section 3.4).
double compatibility(const Vec3& a, const Vec3& b) {
  return std::clamp((a.dot(b) - incompatible_cosine) / (compatible_cosine - incompatible_cosine), 0.0, 1.0);
}

}  // namespace

void CorrespondenceTerms::add_form(Index point, const Mat3& form, const Vec3& right_hand_side) {
  forms.row(point) +=
      (Eigen::RowVectorXd(6) << form(0, 0), form(1, 1), form(2, 2), form(0, 1), form(0, 2), form(1, 2))
          .finished();
  right_hand_sides.row(point) += right_hand_side.transpose();
}

void CorrespondenceTerms::add(Index point, const Vec3& displacement, const Vec3& normal, double tangential,
                              double weight) {
  const Mat3 form =
      weight * ((1.0 - tangential) * normal * normal.transpose() + tangential * Mat3::Identity());
  add_form(point, form, form * displacement);
}

void CorrespondenceTerms::add_along(const SurfacePoints& surface, PointsIn places, double weight,
                                    double distance) {
  for (Index i = 0; i < places.rows(); ++i) {
    const Vec3 displacement = (places.row(i) - surface.points.row(i)).transpose(),
               normal = surface.normals.row(i);
    const double share = std::pow(1.0 + displacement.squaredNorm() / (distance * distance), -2);
    const Mat3 form =
        weight * share * surface.area_weights[i] * (Mat3::Identity() - normal * normal.transpose());
    add_form(i, form, form * displacement);
  }
}

void CorrespondenceTerms::add_curvature(const WrapTarget& target, const SurfacePoints& surface,
                                        const std::vector<Index>& target_of, double weight) {
  const Index n = surface.points.rows();
  RowMatrix<double> differences(n, 2);
  for (Index i = 0; i < n; ++i) {
    const Index k = target_of[i];
    const Vec3 offset = (surface.points.row(i) - target.points.row(k)).transpose();
    for (int c = 0; c < 2; ++c)
      differences(i, c) = surface.curvatures(i, c) - target.curvature.values(k, c) -
                          target.curvature.gradients.row(k).segment<3>(3 * c).dot(offset);
  }
  for (int c = 0; c < 2; ++c) {
    std::vector<double> sizes(n);
    for (Index i = 0; i < n; ++i) sizes[i] = std::abs(differences(i, c));
    std::nth_element(sizes.begin(), sizes.begin() + n / 2, sizes.end());
    const double usual = deviation_of_median * sizes[n / 2] + 1e-6;
    for (Index i = 0; i < n; ++i) {
      const Vec3 gradient =
          target.curvature.gradients.row(target_of[i]).segment<3>(3 * c).transpose() / usual;
      const double difference = differences(i, c) / usual;
      const double robust = 1.0 / (1.0 + std::pow(difference / curvature_outlier, 2));
      const double w = weight * match_weights[i] * surface.area_weights[i] * robust * robust;
      add_form(i, w * gradient * gradient.transpose(), w * difference * gradient);
    }
  }
}

CorrespondenceTerms::CorrespondenceTerms(const WrapTarget& target, const SurfacePoints& surface,
                                         const CorrespondenceWeights& weights) {
  const Points &points = surface.points, &normals = surface.normals;
  const Index n = points.rows(), m = target.points.rows();
  forms.setZero(n, 6);
  right_hand_sides.setZero(n, 3);
  match_weights.setZero(n);

  // From the surface to the target.
  const OrientedPoints tree(points, normals);
  const std::vector<Index> target_of = target.tree.nearest(points, normals, weights.normals);
  const std::vector<Index> source_of = tree.nearest(target.points, target.normals, weights.normals);
  double unmatched = 0.0;
  for (Index i = 0; i < n; ++i) {
    const Index k = target_of[i];
    const Vec3 displacement = (target.points.row(k) - points.row(i)).transpose(),
               normal = target.normals.row(k);
    double weight = compatibility(normal, normals.row(i)) * target.interior[k];
    if (!target.closed && weight > 0.0) {  // only if the closest point of the closest point is near
      const double missed = (points.row(source_of[k]) - points.row(i)).norm();
      if (missed > return_spacings * target.spacing + return_share * displacement.norm()) weight = 0.0;
    }
    if (!(weight > 0.0)) {
      unmatched += surface.area_weights[i];
      continue;
    }
    match_weights[i] = weight;
    add(i, displacement, normal, weights.tangential, weights.weight * weight * surface.area_weights[i]);
  }
  matched_share = 1.0 - unmatched;

  if (weights.curvature > 0.0 && surface.curvatures.rows() == n && target.curvature.values.rows() == m)
    add_curvature(target, surface, target_of, weights.curvature);

  // From the target to the surface.
  for (Index k = 0; k < m && weights.coverage > 0.0; ++k) {
    const Index i = source_of[k];
    const Vec3 normal = target.normals.row(k);
    const double weight = compatibility(normal, normals.row(i));
    if (weight > 0.0)
      add(i, (target.points.row(k) - points.row(i)).transpose(), normal, weights.tangential,
          weights.weight * weights.coverage * weight / static_cast<double>(m));
  }

  // From the surface to the target, without regard to normals.
  if (!(weights.unoriented > 0.0)) return;
  const std::vector<Index> nearest = target.tree.nearest(points, normals, 0.0);
  for (Index i = 0; i < n; ++i) {
    const Index k = nearest[i];
    if (!target.closed && !(match_weights[i] > 0.0)) continue;
    add(i, (target.points.row(k) - points.row(i)).transpose(), target.normals.row(k), weights.tangential,
        weights.unoriented * weights.weight * target.interior[k] * surface.area_weights[i]);
  }
}

}  // namespace arapfields
