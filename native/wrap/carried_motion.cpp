// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/carried_motion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <utility>

#include "core/parallel.h"
#include "mesh/is_closed.h"

namespace arapfields {
namespace {

/// The length L, as a fraction of the diagonal, below which differences prevail over M(δ), and over which J
/// is smoothed.
constexpr double edge_length = 0.03;
/// Least cotangent weight: obtuse triangles would have negative ones, which fold.
constexpr double least_weight = 0.01;
/// Relative deviation of J times the edge between two places from the receiving edge, above which the places
/// contradict it.
constexpr double contradiction = 0.5;
/// Displacements below this fraction of the largest are set to 0 where the giving mesh does not move.
constexpr double no_motion = 1e-4;
/// Most solves after the first, each with the differences at folded triangles halved.
constexpr int most_rounds = 6;

}  // namespace

CarriedMotion::CarriedMotion(const TriangleMesh& giving, const TriangleMesh& receiving,
                             const SurfacePlaces& places, DisplacementMap map, const Progress& progress)
    : giving_(giving),
      receiving_(receiving),
      places_(places),
      first_(first_at_position(receiving.vertices)),
      giving_first_(first_at_position(giving.vertices)),
      map_(std::move(map)),
      jacobians_(map_.jacobians()) {
  const Index count = receiving.vertices.rows();
  std::map<std::pair<std::int32_t, std::int32_t>, double> weights;
  Vector areas = Vector::Zero(count);
  for (Index t = 0; t < receiving.triangles.rows(); ++t) {
    const auto corner = [&](int k) -> Vec3 { return receiving.vertices.row(receiving.triangles(t, k % 3)); };
    const double area = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() / 2.0;
    if (!(area > 0.0)) continue;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t i = first_[receiving.triangles(t, k)],
                         j = first_[receiving.triangles(t, (k + 1) % 3)];
      areas[i] += area / 3.0;
      if (i != j)
        weights[std::minmax(i, j)] +=
            (corner(k) - corner(k + 2)).dot(corner(k + 1) - corner(k + 2)) / (4.0 * area);
    }
  }
  progress.check();

  const double length = edge_length * diagonal_of(receiving.vertices);
  anchors_ = areas / std::max(length * length, 1e-300);
  for (Index v = 0; v < count; ++v)
    if (!(anchors_[v] > 0.0)) anchors_[v] = 1.0;  // isolated vertices, and duplicates at a position
  std::vector<Eigen::Triplet<double>> entries;
  for (Index v = 0; v < count; ++v) entries.emplace_back(v, v, anchors_[v]);
  edges_.reserve(weights.size());
  for (const auto& [ends, weight] : weights) {
    const auto [i, j] = ends;
    const double w = std::max(weight, least_weight);
    edges_.push_back({i, j, w, Mat3::Zero(), Vec3::Zero()});
    entries.insert(entries.end(), {{i, i, w}, {j, j, w}, {j, i, -w}});
  }
  Eigen::SparseMatrix<double> matrix(count, count);  // the lower triangle
  matrix.setFromTriplets(entries.begin(), entries.end());
  factor_.analyzePattern(matrix);
  progress.check();
  factor_.factorize(matrix);
  progress.check();

  // Smooths J over the length L.
  Eigen::Matrix<double, Eigen::Dynamic, 9> smooth(count, 9);
  for (Index v = 0; v < count; ++v)
    smooth.row(v) = anchors_[v] * Eigen::Map<const Eigen::Matrix<double, 1, 9>>(jacobians_[first_[v]].data());
  smooth = factor_.solve(smooth).eval();
  for (Index v = 0; v < count; ++v)
    Eigen::Map<Eigen::Matrix<double, 1, 9>>(jacobians_[v].data()) = smooth.row(first_[v]);
  add_edges();
}

void CarriedMotion::add_edges() {
  const auto place = [&](Index i) -> Vec3 {
    return places_.interpolated(giving_.triangles, i, [&](Index v) { return giving_.vertices.row(v); })
        .transpose();
  };
  for (Edge& edge : edges_) {
    edge.jacobian = 0.5 * (jacobians_[edge.begin] + jacobians_[edge.end]);
    const Vec3 here = receiving_.vertices.row(edge.begin) - receiving_.vertices.row(edge.end);
    const Vec3 there = edge.jacobian * (place(edge.begin) - place(edge.end));
    if ((there - here).norm() > contradiction * here.norm() && edge.jacobian.determinant() != 0.0)
      edge.back = edge.jacobian.inverse() * here;
  }
  giving_areas_.setZero(giving_.triangles.rows());
  slopes_.assign(giving_.triangles.rows(), Eigen::Matrix<double, 3, 2>::Zero());
  for (Index t = 0; t < giving_.triangles.rows(); ++t) {
    const Vec3 origin = giving_.vertices.row(giving_.triangles(t, 0));
    Eigen::Matrix<double, 3, 2> sides;
    for (int k = 0; k < 2; ++k)
      sides.col(k) = giving_.vertices.row(giving_.triangles(t, k + 1)).transpose() - origin;
    const Eigen::Matrix2d gram = sides.transpose() * sides;
    giving_areas_[t] = sides.col(0).cross(sides.col(1)).norm();
    const Eigen::Matrix<double, 3, 2> slopes = sides * gram.inverse();
    if (slopes.allFinite())
      slopes_[t] = slopes;
    else
      giving_areas_[t] = 0.0;
  }
}

/// Gradients of the giving vertices' displacements: area-weighted means over their triangles.
std::vector<Mat3> CarriedMotion::gradients(PointsIn given) const {
  std::vector<Mat3> result(given.rows(), Mat3::Zero());
  Vector areas = Vector::Zero(given.rows());
  for (Index t = 0; t < giving_.triangles.rows(); ++t) {
    Eigen::Matrix<double, 3, 2> differences;
    for (int k = 0; k < 2; ++k)
      differences.col(k) = given.row(giving_.triangles(t, k + 1)) - given.row(giving_.triangles(t, 0));
    const Mat3 gradient = giving_areas_[t] * differences * slopes_[t].transpose();
    for (int k = 0; k < 3; ++k) {
      result[giving_first_[giving_.triangles(t, k)]] += gradient;
      areas[giving_first_[giving_.triangles(t, k)]] += giving_areas_[t];
    }
  }
  for (Index v = 0; v < given.rows(); ++v)
    if (areas[v] > 0.0) result[v] /= areas[v];
  for (Index v = 0; v < given.rows(); ++v) result[v] = result[giving_first_[v]];
  return result;
}

Points CarriedMotion::operator()(PointsIn given, const Progress& progress) const {
  const Index count = anchors_.size();
  const std::vector<Mat3> slopes = gradients(given);
  Points at_place(count, 3);
  for (Index v = 0; v < count; ++v)
    at_place.row(v) =
        places_.interpolated(giving_.triangles, first_[v], [&](Index g) { return given.row(g); });
  const Points mapped = map_(at_place, progress);
  const Eigen::MatrixX3d anchored = anchors_.asDiagonal() * mapped;
  Points differences(static_cast<Index>(edges_.size()), 3);
  for (std::size_t k = 0; k < edges_.size(); ++k) {
    const Edge& edge = edges_[k];
    Vec3 carried;
    if (edge.back.isZero(0.0)) {
      const double trust = std::min(map_.trust()[edge.begin], map_.trust()[edge.end]);
      const Vec3 difference = at_place.row(edge.begin) - at_place.row(edge.end),
                 whole = mapped.row(edge.begin) - mapped.row(edge.end);
      carried = trust * whole + (1.0 - trust) * (edge.jacobian * difference);
    } else {
      const auto slope = [&](std::int32_t v) {
        return places_.interpolated(giving_.triangles, v, [&](Index g) -> const Mat3& { return slopes[g]; });
      };
      carried = edge.jacobian * (0.5 * (slope(edge.begin) + slope(edge.end)) * edge.back);
    }
    differences.row(k) = edge.weight * carried.transpose();
  }

  Vector kept = Vector::Ones(count);
  Points result(count, 3);
  for (int round = 0;; ++round) {
    Eigen::MatrixX3d right = anchored;
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const Eigen::RowVector3d moved =
          std::min(kept[edges_[k].begin], kept[edges_[k].end]) * differences.row(k);
      right.row(edges_[k].begin) += moved;
      right.row(edges_[k].end) -= moved;
    }
    progress.check();
    result = factor_.solve(right);
    if (round == most_rounds || !spare_folds(given, result, kept)) break;
  }
  const double least = no_motion * result.rowwise().norm().maxCoeff();
  for (Index v = 0; v < count; ++v)
    if (at_place.row(v).isZero(0.0) && result.row(v).norm() < least) result.row(v).setZero();
  for (Index v = 0; v < count; ++v) result.row(v) = result.row(first_[v]).eval();
  return result;
}

bool CarriedMotion::spare_folds(PointsIn given, const Points& moved, Vector& kept) const {
  const auto folds = [](const TriangleMesh& mesh, Index t, auto&& motion) {
    const auto normal = [&](auto&& at) {
      const Vec3 origin = at(mesh.triangles(t, 0));
      return (at(mesh.triangles(t, 1)) - origin).cross(at(mesh.triangles(t, 2)) - origin).eval();
    };
    const auto rest = [&](Index v) -> Vec3 { return mesh.vertices.row(v); };
    return normal(rest).dot(normal([&](Index v) -> Vec3 { return rest(v) + motion(v); })) < 0.0;
  };
  std::vector<Index> folded;
  for (Index t = 0; t < receiving_.triangles.rows(); ++t)
    if (folds(receiving_, t, [&](Index v) -> Vec3 { return moved.row(first_[v]); })) folded.push_back(t);
  if (folded.empty()) return false;
  std::vector<bool> meant(given.rows(), false);  // whether a triangle of the giving vertex folds too
  for (Index t = 0; t < giving_.triangles.rows(); ++t)
    if (folds(giving_, t, [&](Index g) -> Vec3 { return given.row(g); }))
      for (int k = 0; k < 3; ++k) meant[giving_first_[giving_.triangles(t, k)]] = true;
  bool found = false;
  for (const Index t : folded) {
    bool spared = true;
    for (int k = 0; k < 9; ++k) {
      const Index place = places_.triangles[first_[receiving_.triangles(t, k % 3)]];
      spared = spared && !meant[giving_first_[giving_.triangles(place, k / 3)]];
    }
    if (!spared) continue;
    for (int k = 0; k < 3; ++k) kept[first_[receiving_.triangles(t, k)]] *= 0.5;
    found = true;
  }
  return found;
}

}  // namespace arapfields
