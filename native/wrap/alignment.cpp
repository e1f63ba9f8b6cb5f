// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/alignment.h"

#include <algorithm>
#include <cmath>

#include "core/decompositions.h"
#include "core/errors.h"
#include "energies/alignment.h"
#include "mesh/triangle_mesh.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

void require_on(PointsIn surface, PointsIn places, const char* which) {
  const Vector distances = nearest_distances(surface, places);
  const double size = diagonal_of(surface);
  for (Index i = 0; i < places.rows(); ++i)
    require(distances[i] <= off_surface * size, landmark_name(i),
            std::string(which) + " is " + percent_text(distances[i] / size) +
                " of the surface's size away from it",
            "a place on the surface is needed");
}

Points some_rows(PointsIn points, Index count) {
  const Index taken = std::min<Index>(count, points.rows());
  Points result(taken, 3);
  for (Index i = 0; i < taken; ++i) result.row(i) = points.row(i * points.rows() / taken);
  return result;
}

/// Iterative closest points (Besl, McKay 1992) with normals, in both directions.
class IterativeClosestPoints {
 public:
  IterativeClosestPoints(const WrapSource& source, const WrapTarget& target, Index count, double scale,
                         double normal_weight)
      : points_(some_rows(source.points, count)),
        normals_(some_rows(source.normals, count)),
        target_points_(some_rows(target.points, count)),
        target_normals_(some_rows(target.normals, count)),
        source_(source),
        target_(target),
        tree_(points_, normals_),
        scale_(scale),
        normal_weight_(normal_weight) {}

  /// The mean distance of pairs, including normals, and the placement after `rounds` rounds from `at`.
  std::pair<double, Similarity> improve(Similarity at, int rounds) const {
    double mean = 0.0;
    std::vector<Index> target_of, source_of;
    for (int round = 0; round <= rounds; ++round) {
      // Closest points in both directions.
      const Points moved = at.of(points_), moved_normals = normals_ * at.rotation.transpose();
      target_of = target_.tree.nearest(moved, moved_normals, normal_weight_ * at.scale, target_of);
      const Points back_points = at.inverse_of(target_points_), back_normals = target_normals_ * at.rotation;
      source_of = tree_.nearest(back_points, back_normals, normal_weight_, source_of);

      // Pairs, and landmarks among them.
      const Index n = moved.rows(), m = target_points_.rows(), k = source_.landmarks.rows();
      Points from(n + m + k, 3), to(n + m + k, 3);
      Vector weights = Vector::Ones(n + m + k);
      double sum = 0.0;
      for (Index i = 0; i < n; ++i) {
        const Index row = target_of[i];
        from.row(i) = points_.row(i);
        to.row(i) = target_.points.row(row);
        weights[i] = target_.interior[row];
        sum += weights[i] *
               distance(moved.row(i) - to.row(i), moved_normals.row(i) - target_.normals.row(row), at);
      }
      for (Index i = 0; i < m; ++i) {
        const Index row = source_of[i];
        from.row(n + i) = points_.row(row);
        to.row(n + i) = target_points_.row(i);
        sum += distance(to.row(n + i) - moved.row(row), target_normals_.row(i) - moved_normals.row(row), at);
      }
      mean = sum / std::max(weights.head(n + m).sum(), 1.0);
      if (k > 0) {
        from.bottomRows(k) = source_.landmarks;
        to.bottomRows(k) = source_.landmark_targets;
        weights.tail(k).setConstant(landmark_share * weights.head(n + m).sum() / static_cast<double>(k));
        mean += source_.distances(at).mean();
      }
      if (round < rounds) at = fitted_similarity(from, to, weights, scale_);
    }
    return {mean, at};
  }

 private:
  template <class Offset, class Difference>
  double distance(const Offset& offset, const Difference& normals, const Similarity& at) const {
    const double weight = normal_weight_ * normal_weight_ * at.scale * at.scale;
    return std::sqrt(offset.squaredNorm() + weight * normals.squaredNorm());
  }

  Points points_, normals_, target_points_, target_normals_;
  const WrapSource& source_;
  const WrapTarget& target_;
  OrientedPoints tree_;
  double scale_, normal_weight_;
};

/// Columns: principal axes, right-handed.
Mat3 principal_axes(PointsIn points) {
  const Eigen::RowVector3d middle = points.colwise().mean();
  const Points arms = points.rowwise() - middle;
  Mat3 axes = symmetric_eigen3(cross_moments(arms, arms)).vectors;
  if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
  return axes;
}

/// The identity and the 24 rotations that align the principal axes.
std::vector<Mat3> candidate_rotations(PointsIn from, PointsIn to) {
  const Mat3 a = principal_axes(from), b = principal_axes(to);
  std::vector<Mat3> result{Mat3::Identity()};
  for (int x = 0; x < 3; ++x)
    for (int y = 0; y < 3; ++y)
      for (int signs = 0; signs < 4 && y != x; ++signs) {
        Mat3 turn = Mat3::Zero();
        turn(x, 0) = (signs & 1) != 0 ? -1.0 : 1.0;
        turn(y, 1) = (signs & 2) != 0 ? -1.0 : 1.0;
        turn.col(2) = turn.col(0).cross(turn.col(1));
        result.push_back(b * turn * a.transpose());
      }
  return result;
}

Similarity by_shape(const WrapSource& source, const WrapTarget& target, double scale, double normal_weight,
                    std::vector<std::string>& warnings, const Progress& progress) {
  const IterativeClosestPoints coarse(source, target, coarse_samples, scale, normal_weight),
      fine(source, target, fine_samples, scale, normal_weight);
  std::vector<std::pair<double, Similarity>> candidates;
  const double growth = scale > 0.0 ? scale : gyration(target.points) / gyration(source.points);
  for (const Mat3& rotation : candidate_rotations(source.points, target.points)) {
    Similarity at{growth, rotation, Vec3::Zero()};
    at.translation = target.points.colwise().mean().transpose() -
                     growth * rotation * source.points.colwise().mean().transpose();
    candidates.push_back(coarse.improve(at, coarse_rounds));
    progress.check();
  }
  std::sort(candidates.begin() + 1, candidates.end(),  // the identity, the first, is always refined
            [](const auto& a, const auto& b) { return a.first < b.first; });
  std::pair<double, Similarity> best = fine.improve(candidates[0].second, fine_rounds);
  double least = turn_gain * best.first;
  for (std::size_t i = 1; i < std::min<std::size_t>(finalists, candidates.size()); ++i) {
    const auto refined = fine.improve(candidates[i].second, fine_rounds);
    if (refined.first < least) {
      best = refined;
      least = refined.first;
    }
    progress.check();
  }
  const double share = best.first / target.diagonal;
  if (share > unlike_shapes)
    warnings.push_back(
        "the shapes are not alike: placed, they are " + percent_text(share) +
        " of the target's size apart, normals counted; pairs of landmarks would say what belongs "
        "to what");
  return best.second;
}

void check_fit(const WrapSource& source, const WrapTarget& target, const Similarity& placement,
               std::vector<std::string>& warnings) {
  const Vector distances = source.distances(placement);
  const double share = distances.mean() / target.diagonal;
  Index worst = 0;
  distances.maxCoeff(&worst);
  if (share > poor_landmarks)
    warnings.push_back("the landmarks fit no turn of the whole: they stay " + percent_text(share) +
                       " of the target's size from where they belong, " + landmark_name(worst) +
                       " the farthest");
}

}  // namespace

std::string landmark_name(Index i) { return "landmarks[" + std::to_string(i) + "]"; }

std::string percent_text(double share) { return number_text(std::round(1000.0 * share) / 10.0) + " %"; }

double gyration(PointsIn points) {
  const Eigen::RowVector3d middle = points.colwise().mean();  // evaluated once, not for each point
  return std::sqrt((points.rowwise() - middle).rowwise().squaredNorm().mean());
}

Similarity fitted_similarity(PointsIn from, PointsIn to, const Vector& weights, double scale) {
  Similarity result;
  result.rotation = best_alignment(from, to, weights).rotation;
  const double total = weights.sum();
  const Eigen::RowVector3d a = weights.transpose() * from / total, b = weights.transpose() * to / total;
  const Points arms = from.rowwise() - a, target_arms = to.rowwise() - b;
  const double square = weights.dot(arms.rowwise().squaredNorm());
  const double along =
      weights.dot((arms * result.rotation.transpose()).cwiseProduct(target_arms).rowwise().sum());
  result.scale = scale > 0.0 ? scale : square > 0.0 && along > 0.0 ? along / square : 1.0;
  result.translation = b.transpose() - result.scale * result.rotation * a.transpose();
  return result;
}

WrapSource WrapSource::with_landmarks(const std::vector<Index>& rows) const {
  WrapSource result = *this;
  result.landmarks = rows_of(landmarks, rows);
  result.landmark_targets = rows_of(landmark_targets, rows);
  return result;
}

Vector WrapSource::distances(const Similarity& placement) const {
  return (placement.of(landmarks) - landmark_targets).rowwise().norm();
}

void check_landmarks(const WrapSource& source, const WrapTarget& target) {
  const Index count = source.landmarks.rows();
  for (Index i = 0; i < count; ++i)
    require(std::isfinite(source.landmarks.row(i).squaredNorm()) &&
                std::isfinite(source.landmark_targets.row(i).squaredNorm()),
            landmark_name(i), "a coordinate is NaN, infinite or too large", "squares must be finite");
  if (count == 0) return;
  require_on(source.points, source.landmarks, "its place at rest");
  require_on(target.points, source.landmark_targets, "its place on the target");
}

void check_contradictions(const WrapSource& source, const WrapTarget& target,
                          const std::vector<Index>& rows) {
  const double size = diagonal_of(source.points);
  for (const Index i : rows)
    for (const Index j : rows) {
      if (j >= i) break;
      const double source_distance = (source.landmarks.row(i) - source.landmarks.row(j)).norm() / size;
      const double target_distance =
          (source.landmark_targets.row(i) - source.landmark_targets.row(j)).norm() / target.diagonal;
      const bool torn = source_distance < same_point && target_distance > different_points,
                 merged = target_distance < same_point && source_distance > different_points;
      require(!torn && !merged, landmark_name(j) + " and " + landmark_name(i),
              torn ? "one place at rest belongs to two on the target" : "two places at rest belong to one",
              "they contradict each other");
    }
}

Similarity wrap_alignment(const WrapSource& source, const WrapTarget& target, AlignmentKind kind,
                          double normal_weight, std::vector<std::string>& warnings,
                          const Progress& progress) {
  const double scale = kind == AlignmentKind::similar ? 0.0 : source.frame.scale;
  if (kind == AlignmentKind::none) return {scale, Mat3::Identity(), source.frame.center};
  if (source.landmarks.rows() < 3) return by_shape(source, target, scale, normal_weight, warnings, progress);
  const Similarity placement = fitted_similarity(source.landmarks, source.landmark_targets,
                                                 Vector::Ones(source.landmarks.rows()), scale);
  check_fit(source, target, placement, warnings);
  return placement;
}

}  // namespace arapfields
