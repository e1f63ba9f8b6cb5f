// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/multidimensional_scaling.h"

#include <cmath>
#include <limits>

#include "core/decompositions.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

/// Rounds over the landmarks, which unfold slowly where they begin in one place, and over the others, which
/// hang on the landmarks alone.
constexpr int landmark_rounds = 40, other_rounds = 15;

/// The coordinate that minimises the bound of a point's stress.
Eigen::RowVector3d less_stressed(Index point, const Points& landmarks, const Eigen::RowVector3d& from,
                                 const RowMatrix<double>& distances, const RowMatrix<double>& weights) {
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  double whole = 0.0;
  for (Index l = 0; l < landmarks.rows(); ++l) {
    const Eigen::RowVector3d way = from - landmarks.row(l);
    const double apart = std::max(way.norm(), std::numeric_limits<double>::min()), weight = weights(point, l);
    sum += weight * (landmarks.row(l) + distances(point, l) / apart * way);
    whole += weight;
  }
  return sum / whole;
}

}  // namespace

Points classical_scaling(const RowMatrix<double>& squares) {
  const Index count = squares.cols();
  const RowMatrix<double> own = 0.5 * (squares.topRows(count) + squares.topRows(count).transpose());
  const Vector mean = own.rowwise().mean();
  RowMatrix<double> products = -0.5 * own;
  products.colwise() += 0.5 * mean;
  products.rowwise() += 0.5 * mean.transpose();
  products.array() -= 0.5 * mean.mean();
  const auto eigen = symmetric_eigen(products);
  Points result = Points::Zero(squares.rows(), 3);
  for (int k = 0; k < 3; ++k) {
    const double value = eigen.values[count - 1 - k];
    if (!(value > 1e-12)) continue;
    Vector direction = eigen.vectors.col(count - 1 - k) / std::sqrt(value);
    result.col(k) = -0.5 * (squares * direction).array() + 0.5 * mean.dot(direction);
  }
  return result;
}

void reduce_stress(const RowMatrix<double>& squares, const RowMatrix<double>& weights, Points& coordinates) {
  const Index count = squares.cols();
  const RowMatrix<double> distances = squares.cwiseSqrt();
  Points landmarks = coordinates.topRows(count);
  for (int round = 0; round < landmark_rounds; ++round)
    for (Index i = 0; i < count; ++i)
      landmarks.row(i) = less_stressed(i, landmarks, landmarks.row(i), distances, weights);
  coordinates.topRows(count) = landmarks;
  parallel_for(count, coordinates.rows(), 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      Eigen::RowVector3d at = coordinates.row(i);
      for (int round = 0; round < other_rounds; ++round)
        at = less_stressed(i, landmarks, at, distances, weights);
      coordinates.row(i) = at;
    }
  });
}

}  // namespace arapfields
