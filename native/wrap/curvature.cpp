// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/curvature.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "core/decompositions.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

/// Cut-off of the Gaussian weights, in radii: exp(−4) there.
constexpr double weights_end = 2.0;
/// Tikhonov term of the fits, as a fraction of the sum of weights: few or collinear points then give a plane.
constexpr double fit_ridge = 1e-4;

/// Calls visit(row, u, v, h, weight) for the points about a place, in its tangent frame and in radii.
template <class Visit>
void visit_about(const OrientedPoints& surface, const Vec3& place, const Vec3& normal, double radius,
                 Visit&& visit) {
  const Vec3 first = normal.unitOrthogonal(), second = normal.cross(first);
  surface.visit_within(place, weights_end * radius,
                       [&](Index k, const Vec3& point, const Vec3& point_normal) {
                         const double facing = point_normal.dot(normal);
                         if (!(facing > 0.0)) return;
                         const Vec3 offset = (point - place) / radius;
                         visit(k, offset.dot(first), offset.dot(second), offset.dot(normal),
                               facing * std::exp(-offset.squaredNorm()));
                       });
}

}  // namespace

RowMatrix<double> curvature_values(PointsIn points, PointsIn normals, PointsIn places, PointsIn place_normals,
                                   double radius, const Progress& progress) {
  const OrientedPoints surface(points, normals);
  using Vec6 = Eigen::Matrix<double, 6, 1>;
  using Mat6 = Eigen::Matrix<double, 6, 6>;
  RowMatrix<double> result(places.rows(), 2);
  parallel_for(0, places.rows(), 64, [&](Index begin, Index end) {
    for (Index i = begin; i < end && !progress.cancelled(); ++i) {
      Mat6 matrix = Mat6::Zero();
      Vec6 column = Vec6::Zero();
      double sum = 0.0;
      visit_about(surface, places.row(i), place_normals.row(i), radius,
                  [&](Index /*row*/, double u, double v, double h, double weight) {
                    Vec6 terms;
                    terms << 1.0, u, v, u * u, u * v, v * v;
                    const Vec6 weighted = weight * terms;  // its lower triangle, in blocks of two rows
                    matrix.topLeftCorner<2, 2>() += weighted.head<2>() * terms.head<2>().transpose();
                    matrix.block<2, 4>(2, 0) += weighted.segment<2>(2) * terms.head<4>().transpose();
                    matrix.bottomRows<2>() += weighted.tail<2>() * terms.transpose();
                    column += weight * h * terms;
                    sum += weight;
                  });
      matrix.diagonal().array() += fit_ridge * sum + 1e-300;
      const Vec6 quadric = matrix.ldlt().solve(column);
      const double slope = 1.0 + quadric[1] * quadric[1] + quadric[2] * quadric[2];
      const double mean = (quadric[3] + quadric[5]) / std::sqrt(slope),
                   half = std::hypot(quadric[3] - quadric[5], quadric[4]) / std::sqrt(slope);
      result(i, 0) = std::isfinite(mean) ? mean : 0.0;
      result(i, 1) = std::isfinite(half) ? half : 0.0;
    }
  });
  progress.check();
  return result;
}

SurfaceCurvature curvature_at(PointsIn points, PointsIn normals, PointsIn places, PointsIn place_normals,
                              double radius, const Progress& progress) {
  const RowMatrix<double> values = curvature_values(points, normals, points, normals, radius, progress);
  const OrientedPoints surface(points, normals);
  const double near = radius / weights_end;
  SurfaceCurvature result{radius, RowMatrix<double>::Zero(places.rows(), 2),
                          RowMatrix<double>::Zero(places.rows(), 6)};
  parallel_for(0, places.rows(), 64, [&](Index begin, Index end) {
    for (Index i = begin; i < end && !progress.cancelled(); ++i) {
      Mat3 matrix = Mat3::Zero(), columns = Mat3::Zero();
      visit_about(surface, places.row(i), place_normals.row(i), near,
                  [&](Index k, double u, double v, double /*h*/, double weight) {
                    const Vec3 terms(1.0, u, v);
                    matrix.noalias() += weight * terms * terms.transpose();
                    columns.leftCols(2).noalias() += weight * terms * values.row(k);
                  });
      matrix.diagonal().array() += fit_ridge * matrix(0, 0) + 1e-300;
      const Vec3 normal = place_normals.row(i), first = normal.unitOrthogonal(), second = normal.cross(first);
      for (int c = 0; c < 2; ++c) {
        const Vec3 fit = solve_definite(matrix, columns.col(c));
        result.values(i, c) = fit[0];
        result.gradients.row(i).segment<3>(3 * c) = ((fit[1] * first + fit[2] * second) / near).transpose();
      }
    }
  });
  progress.check();
  return result;
}

}  // namespace arapfields
