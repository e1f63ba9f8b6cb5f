// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/smooth_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "core/random.h"
#include "fields/radial_basis.h"
#include "mesh/sample_mesh.h"
#include "sampling/sample_choice.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

// Tuned on shape keys of shapes with a known map, by the map itself and by wraps. Lengths are fractions of
// the diagonal.

/// Random points on the surface, and the farthest-point samples among them.
constexpr Index candidate_count = 4000, surface_count = 1000;
/// Smoothing parameter of a surface point.
constexpr double point_smoothing = 2e-3;
/// Points off the surface, on both sides, where space is scaled like the square root of the area: they fix
/// the map across flat parts. Their number, offset along the normal, and smoothing parameter.
constexpr Index beside = 250;
constexpr double surface_offset = 0.03, offset_smoothing = 1.0;

/// Error of a point's image at which the map's weight is a quarter.
constexpr double missed_share = 0.03;
/// Largest nonlinear part of a mapped displacement, as a fraction of J δ.
constexpr double most_beyond = 0.5;
/// Fixed-point iterations of the inverse map.
constexpr int back_steps = 4;

Vec3 normal_of(PointsIn vertices, TrianglesIn triangles, Index t) {
  const auto corner = [&](int k) -> Vec3 { return vertices.row(triangles(t, k)); };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0));
}

}  // namespace

SmoothingSpline::SmoothingSpline(PointsIn centers, const Vector& smoothing, const Progress& progress) {
  map_.center_ = centers.colwise().mean();
  map_.size_ = std::max(diagonal_of(centers), 1e-300);
  const Points units = map_.in_units(centers);
  map_.centers_ = units.array();

  Eigen::MatrixXd plane(centers.rows(), 4);
  plane << Vector::Ones(centers.rows()), units;
  turn_ = OrthogonalFactor(plane);
  const Index all = centers.rows(), inner = all - std::min<Index>(4, all);
  if (inner == 0) return;

  // (K + S) w + P a = y with Pᵀ w = 0: definite for w = Q₂ z, Q₂ an orthonormal basis of Pᵀ's null space.
  Eigen::MatrixXd matrix(all, all);
  parallel_for(0, all, 16, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      matrix.col(i) = (units.rowwise() - units.row(i)).rowwise().norm().array().cube().matrix();
  });
  matrix.diagonal() += smoothing;
  progress.check();
  const Eigen::MatrixXd half = turn_.transposed_times(matrix),
                        turned = turn_.transposed_times(half.transpose());
  progress.check();
  across_ = turned.topRightCorner(4, inner);
  factor_ = cholesky<double>(turned.bottomRightCorner(inner, inner));
  progress.check();
}

SmoothMap SmoothingSpline::fit(PointsIn values) const {
  const Index all = values.rows(), plane = std::min<Index>(4, all), inner = all - plane;
  Eigen::MatrixXd right = turn_.transposed_times(values), weights = Eigen::MatrixXd::Zero(all, 3);
  if (inner > 0) {
    weights.bottomRows(inner) = cholesky_solve<double>(factor_, right.bottomRows(inner));
    right.topRows(plane) -= product(across_, weights.bottomRows(inner));
  }
  // Coplanar centers do not determine the affine part across their plane: the minimum-norm one is taken.
  SmoothMap map = map_;
  map.affine_ = least_squares(turn_.upper(), right.topRows(plane));
  map.weights_ = turn_.times(weights).array();
  return map;
}

SmoothMap surface_map(const TriangleMesh& from, PointsIn to, const Progress& progress) {
  const AreaSampler sampler(from.vertices, from.triangles);
  Random random(0);
  Points before(candidate_count, 3), after(candidate_count, 3), normals(candidate_count, 3),
      moved_normals(candidate_count, 3);
  for (Index i = 0; i < candidate_count; ++i) {
    const AreaSampler::Draw draw = sampler.draw(random);
    before.row(i) = draw.point;
    after.row(i).setZero();
    for (int k = 0; k < 3; ++k) after.row(i) += draw.corners[k] * to.row(from.triangles(draw.triangle, k));
    const Vec3 normal = normal_of(from.vertices, from.triangles, draw.triangle),
               moved = normal_of(to, from.triangles, draw.triangle);
    normals.row(i) = normal.normalized();
    moved_normals.row(i) = moved / std::sqrt(std::max(moved.norm() * normal.norm(), 1e-300));
  }
  const std::vector<Index> rows = farthest_points(before, surface_count).indices;
  const auto count = static_cast<Index>(rows.size()), sides = std::min(beside, count), all = count + sides;
  Points values(all, 3), centers(all, 3);
  Vector least = Vector::Constant(all, point_smoothing);
  centers.topRows(count) = rows_of(before, rows);
  values.topRows(count) = rows_of(after, rows);
  const double size = diagonal_of(before);
  for (Index i = 0; i < sides; ++i) {
    const double height = (i % 2 == 0 ? surface_offset : -surface_offset) * size;
    centers.row(count + i) = before.row(rows[i]) + height * normals.row(rows[i]);
    values.row(count + i) = after.row(rows[i]) + height * moved_normals.row(rows[i]);
    least[count + i] = offset_smoothing;
  }
  return SmoothingSpline(centers, least, progress).fit(values);
}

template <class Visit>
void SmoothMap::visit(PointsIn points, const Progress& progress, Visit&& visit) const {
  const Points x = in_units(points);
  parallel_for(0, x.rows(), 64, [&](Index begin, Index end) {
    Columns offsets(centers_.rows(), 3);
    Eigen::ArrayXd distances(centers_.rows());
    if (progress.cancelled()) return;
    for (Index i = begin; i < end; ++i) {
      offsets = -(centers_.rowwise() - x.row(i).array());
      distances = offsets.square().rowwise().sum().sqrt();
      visit(i, x.row(i), offsets, distances);
    }
  });
  progress.check();
}

Points SmoothMap::at(PointsIn points, const Progress& progress) const {
  Points result(points.rows(), 3);
  visit(points, progress, [&](Index i, const auto& x, const auto& /*offsets*/, const auto& distances) {
    result.row(i) = affine_.row(0) + x * affine_.bottomRows<3>() +
                    distances.cube().matrix().transpose() * weights_.matrix();
  });
  return result;
}

std::vector<Mat3> SmoothMap::jacobians(PointsIn points, const Progress& progress) const {
  std::vector<Mat3> result(points.rows());
  visit(points, progress, [&](Index i, const auto& /*x*/, const auto& offsets, const auto& distances) {
    const Columns slopes = offsets.colwise() * (3.0 * distances);
    result[i] =
        (affine_.bottomRows<3>().transpose() + weights_.matrix().transpose() * slopes.matrix()) / size_;
  });
  return result;
}

DisplacementMap::DisplacementMap(SmoothMap map, PointsIn points, PointsIn images, std::vector<Mat3> jacobians,
                                 bool back, const Progress& progress)
    : map_(std::move(map)),
      points_(points),
      at_points_(map_.at(points, progress)),
      jacobians_(std::move(jacobians)),
      map_jacobians_(map_.jacobians(points, progress)),
      trust_(points.rows()),
      back_(back) {
  const double far = missed_share * std::max(diagonal_of(images), 1e-300);
  for (Index i = 0; i < trust_.size(); ++i) {
    const double missed = (at_points_.row(i) - images.row(i)).squaredNorm() / (far * far);
    trust_[i] = map_jacobians_[i].determinant() * jacobians_[i].determinant() > 0.0
                    ? std::pow(1.0 + missed, -2.0)
                    : 0.0;
    jacobians_[i] += trust_[i] * (map_jacobians_[i] - jacobians_[i]);
    if (back_) jacobians_[i] = jacobians_[i].inverse().eval();
  }
}

/// The limited nonlinear part f(x + δ) − f(x) − J δ at the points of these rows, with a displacement each.
Points DisplacementMap::beyond_linear(const std::vector<Index>& rows, PointsIn displacements,
                                      const Progress& progress) const {
  const Points there = map_.at(rows_of(points_, rows) + displacements, progress);
  Points result(displacements.rows(), 3);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Index i = rows[k];
    const Vec3 linear = map_jacobians_[i] * displacements.row(k).transpose(),
               beyond = (there.row(k) - at_points_.row(i)).transpose() - linear;
    const double most = most_beyond * linear.norm() / std::max(beyond.norm(), 1e-300);
    result.row(k) = trust_[i] * std::min(1.0, most) * beyond.transpose();
  }
  return result;
}

Points DisplacementMap::operator()(PointsIn displacements, const Progress& progress) const {
  std::vector<Index> rows;
  for (Index i = 0; i < displacements.rows(); ++i)
    if (!displacements.row(i).isZero(0.0)) rows.push_back(i);
  const auto linear = [&](const Points& given) {
    Points result(given.rows(), 3);
    for (std::size_t k = 0; k < rows.size(); ++k)
      result.row(k) = (jacobians_[rows[k]] * given.row(k).transpose()).transpose();
    return result;
  };
  const Points given = rows_of(displacements, rows);
  Points moved = linear(given);
  if (!back_) moved += beyond_linear(rows, given, progress);
  for (int k = 0; back_ && k < back_steps; ++k) moved = linear(given - beyond_linear(rows, moved, progress));
  Points result = Points::Zero(displacements.rows(), 3);
  for (std::size_t k = 0; k < rows.size(); ++k) result.row(rows[k]) = moved.row(k);
  return result;
}

}  // namespace arapfields
