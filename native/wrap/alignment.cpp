// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/alignment.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/errors.h"
#include "energies/alignment.h"
#include "sampling/nearest_sample.h"

namespace arapfields {
namespace {

/// Shares of a surface's diagonal: from which on a landmark is off it; below which two of them are in one
/// place, and from which on they are not.
constexpr double off_surface = 0.1, one_place = 0.005, two_places = 0.1;
/// Landmarks that a turn and a scale leave so far from their targets, as a share of the diagonal, are worth a
/// note; a mirrored set is, where it fits so many times better.
constexpr double poor_landmarks = 0.2, poor_if_mirrored = 0.05, mirrored_gain = 2.0;
/// Mean distance of aligned shapes, as a share of the diagonal, from which on they are not alike.
constexpr double unlike_shapes = 0.035;
/// Points and rounds of the first and the last look at a turn, and how many turns come to the last.
constexpr Index few_points = 300, many_points = 1500;
constexpr int few_rounds = 6, many_rounds = 30, finalists = 4;
/// Share of the pairs' weight that landmarks have where they are too few to decide alone.
constexpr double landmark_share = 0.5;
/// As it lies is preferred to a turn that is not so much better.
constexpr double prefer_upright = 0.9;

double diagonal_of(PointsIn points) {
  return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
}

std::string name(Index i) { return "landmarks[" + std::to_string(i) + "]"; }

std::string percent(double share) { return number_text(std::round(1000.0 * share) / 10.0) + " %"; }

void require_on(PointsIn surface, PointsIn places, const char* which) {
  const Vector distances = nearest_distances(surface, places);
  const double size = diagonal_of(surface);
  for (Index i = 0; i < places.rows(); ++i)
    require(
        distances[i] <= off_surface * size, name(i),
        std::string(which) + " is " + percent(distances[i] / size) + " of the surface's size away from it",
        "a place on the surface is needed");
}

Similarity fit(PointsIn from, PointsIn to, const Vector& weights, double scale) {
  const Alignment turned = best_alignment(from, to, weights);
  Similarity result;
  result.rotation = turned.rotation;
  const double total = weights.sum();
  const Eigen::RowVector3d a = weights.transpose() * from / total, b = weights.transpose() * to / total;
  const Points arms = from.rowwise() - a, wanted = to.rowwise() - b;
  const double square = weights.dot(arms.rowwise().squaredNorm());
  const double along = weights.dot((arms * turned.rotation.transpose()).cwiseProduct(wanted).rowwise().sum());
  result.scale = scale > 0.0 ? scale : square > 0.0 && along > 0.0 ? along / square : 1.0;
  result.translation = b.transpose() - result.scale * result.rotation * a.transpose();
  return result;
}

double residual(const WrapSource& source, const Similarity& placement) {
  return (placement.of(source.landmarks) - source.ends).rowwise().norm().mean();
}

Points some_rows(PointsIn points, Index count) {
  const Index taken = std::min<Index>(count, points.rows());
  Points result(taken, 3);
  for (Index i = 0; i < taken; ++i) result.row(i) = points.row(i * points.rows() / taken);
  return result;
}

/// Brings a surface closer to the target, pair by pair, from a first placement.
class Matching {
 public:
  Matching(const WrapSource& source, const WrapTarget& target, Index count, double scale, double turn)
      : points_(some_rows(source.points, count)),
        normals_(some_rows(source.normals, count)),
        target_points_(some_rows(target.points, count)),
        target_normals_(some_rows(target.normals, count)),
        source_(source),
        target_(target),
        tree_(points_, normals_),
        scale_(scale),
        turn_(turn) {}

  /// The mean distance of pairs, normals counted as well, and the placement after so many rounds.
  std::pair<double, Similarity> improve(Similarity at, int rounds) const {
    double mean = 0.0;
    for (int round = 0; round <= rounds; ++round) {
      // Both ways: what of the target is nearest here, and what of this is nearest there.
      const Points here = at.of(points_), here_normals = normals_ * at.rotation.transpose();
      const std::vector<Index> there = target_.tree.nearest(here, here_normals, turn_ * at.scale);
      const Points back_points = at.inverse_of(target_points_), back_normals = target_normals_ * at.rotation;
      const std::vector<Index> back = tree_.nearest(back_points, back_normals, turn_);
      const Index n = here.rows(), m = target_points_.rows(), k = source_.landmarks.rows();
      Points from(n + m + k, 3), to(n + m + k, 3);
      Vector weights = Vector::Ones(n + m + k);
      double sum = 0.0;
      for (Index i = 0; i < n; ++i) {
        const Index row = there[static_cast<std::size_t>(i)];
        from.row(i) = points_.row(i);
        to.row(i) = target_.points.row(row);
        weights[i] = target_.whole[row];
        sum +=
            weights[i] * apart(here.row(i) - to.row(i), here_normals.row(i) - target_.normals.row(row), at);
      }
      for (Index i = 0; i < m; ++i) {
        const Index row = back[static_cast<std::size_t>(i)];
        from.row(n + i) = points_.row(row);
        to.row(n + i) = target_points_.row(i);
        sum += apart(to.row(n + i) - here.row(row), target_normals_.row(i) - here_normals.row(row), at);
      }
      mean = sum / std::max(weights.head(n + m).sum(), 1.0);
      if (k > 0) {
        from.bottomRows(k) = source_.landmarks;
        to.bottomRows(k) = source_.ends;
        weights.tail(k).setConstant(landmark_share * weights.head(n + m).sum() / static_cast<double>(k));
        mean += residual(source_, at);
      }
      if (round < rounds) at = fit(from, to, weights, scale_);
    }
    return {mean, at};
  }

 private:
  template <class Way, class Turn>
  double apart(const Way& way, const Turn& turn, const Similarity& at) const {
    return std::sqrt(way.squaredNorm() + turn_ * turn_ * at.scale * at.scale * turn.squaredNorm());
  }

  Points points_, normals_, target_points_, target_normals_;
  const WrapSource& source_;
  const WrapTarget& target_;
  OrientedPoints tree_;
  double scale_, turn_;
};

/// Columns: principal axes, right-handed.
Mat3 principal_axes(PointsIn points) {
  const Points arms = points.rowwise() - points.colwise().mean();
  Mat3 axes = Eigen::SelfAdjointEigenSolver<Mat3>(Mat3(arms.transpose() * arms)).eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
  return axes;
}

/// The identity and the 24 turns that take one shape's principal axes to the other's.
std::vector<Mat3> turns_between(PointsIn from, PointsIn to) {
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

double gyration(PointsIn points) {
  return std::sqrt((points.rowwise() - points.colwise().mean()).rowwise().squaredNorm().mean());
}

Similarity by_shape(const WrapSource& source, const WrapTarget& target, double scale, double turn,
                    std::vector<std::string>& notes, const Progress& progress) {
  const Matching few(source, target, few_points, scale, turn), many(source, target, many_points, scale, turn);
  std::vector<std::pair<double, Similarity>> tried;
  const double growth = scale > 0.0 ? scale : gyration(target.points) / gyration(source.points);
  for (const Mat3& rotation : turns_between(source.points, target.points)) {
    Similarity at{growth, rotation, Vec3::Zero()};
    at.translation = target.points.colwise().mean().transpose() -
                     growth * rotation * source.points.colwise().mean().transpose();
    tried.push_back(few.improve(at, few_rounds));
    progress.check();
  }
  tried[0].first *= prefer_upright;
  std::sort(tried.begin(), tried.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::pair<double, Similarity> best{std::numeric_limits<double>::infinity(), {}};
  for (std::size_t i = 0; i < std::min<std::size_t>(finalists, tried.size()); ++i) {
    const auto found = many.improve(tried[i].second, many_rounds);
    if (found.first < best.first) best = found;
    progress.check();
  }
  const double share = best.first / target.diagonal;
  if (share > unlike_shapes)
    notes.push_back("the shapes are not alike: the best turn leaves them " + percent(share) +
                    " of the target's size apart, normals counted; pairs of landmarks would say what belongs "
                    "to what");
  return best.second;
}

void note_landmarks(const WrapSource& source, const WrapTarget& target, const Similarity& placement,
                    std::vector<std::string>& notes) {
  const Vector left = (placement.of(source.landmarks) - source.ends).rowwise().norm();
  const double share = left.mean() / target.diagonal;
  if (share <= poor_if_mirrored) return;
  Index worst = 0;
  left.maxCoeff(&worst);
  WrapSource mirrored = source;
  mirrored.landmarks.col(0) *= -1.0;
  const Similarity other = fit(mirrored.landmarks, mirrored.ends, Vector::Ones(left.size()), 0.0);
  if (mirrored_gain * residual(mirrored, other) < left.mean())
    notes.emplace_back("the landmarks ask for a mirror image: left and right may be exchanged in them");
  else if (share > poor_landmarks)
    notes.push_back("the landmarks fit no turn of the whole: they stay " + percent(share) +
                    " of the target's size from where they belong, " + name(worst) + " the farthest");
}

}  // namespace

void check_landmarks(const WrapSource& source, const WrapTarget& target) {
  const Index count = source.landmarks.rows();
  for (Index i = 0; i < count; ++i)
    require(source.landmarks.row(i).allFinite() && source.ends.row(i).allFinite(), name(i),
            "a coordinate is NaN or infinite", "all must be finite");
  if (count == 0) return;
  require_on(source.points, source.landmarks, "its place at rest");
  require_on(target.points, source.ends, "its place on the target");
  const double size = diagonal_of(source.points);
  for (Index i = 0; i < count; ++i)
    for (Index j = 0; j < i; ++j) {
      const double here = (source.landmarks.row(i) - source.landmarks.row(j)).norm() / size;
      const double there = (source.ends.row(i) - source.ends.row(j)).norm() / target.diagonal;
      const bool torn = here < one_place && there > two_places,
                 merged = there < one_place && here > two_places;
      require(!torn && !merged, name(j) + " and " + name(i),
              torn ? "one place at rest belongs to two on the target" : "two places at rest belong to one",
              "they contradict each other");
    }
}

Similarity wrap_alignment(const WrapSource& source, const WrapTarget& target, AlignmentKind kind, double turn,
                          std::vector<std::string>& notes, const Progress& progress) {
  const double scale = kind == AlignmentKind::similar ? 0.0 : source.frame.scale;
  if (kind == AlignmentKind::none) return {scale, Mat3::Identity(), source.frame.center};
  if (source.landmarks.rows() < 3) return by_shape(source, target, scale, turn, notes, progress);
  const Similarity placement =
      fit(source.landmarks, source.ends, Vector::Ones(source.landmarks.rows()), scale);
  note_landmarks(source, target, placement, notes);
  return placement;
}

}  // namespace arapfields
