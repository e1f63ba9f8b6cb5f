// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/target.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/decompositions.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/types.h"
#include "distance/mesh_sdf.h"
#include "distance/welded_vertices.h"
#include "mesh/sample_mesh.h"
#include "sampling/sample_surface.h"
#include "wrap/parameters.h"

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

namespace {

/// Rounds of averaging normals, which are arbitrary where noise is larger than the edges.
constexpr int normal_rounds = 3;
/// Values are clamped to this multiple of the median absolute value.
constexpr double outlier = 3.7;
/// Fewest pairs of neighbours for an estimate.
constexpr Index enough_pairs = 500;
/// The shape's part in the estimate by second Laplacians, as a fraction of the difference of both estimates:
/// the largest seen on 37 clean meshes of 500 to 60,000 vertices, but for one coarse and shaggy one.
constexpr double shape_share = 0.35;
/// Standard deviation, as a fraction of the diagonal, of noise that is reduced by half.
constexpr double harmless_noise = 0.0003;
/// Iterations of Taubin smoothing and its two factors: wavelengths above about eight edges are kept.
constexpr int smoothing_rounds = 20;
constexpr double smoothing_step = 0.5;
constexpr double smoothing_back = 0.52;
/// Bounds of the smoothing's displacements along the normals, in standard deviations of the noise: of their
/// median (0.7 for noise; 1.1 and more on clean and coarse meshes with edges), and of each vertex.
constexpr double median_move = 1.0, most_move = 4.0;

/// Each vertex's neighbours, once for each common triangle; vertices are welded by position.
class Neighbours {
 public:
  Neighbours(const TriangleMesh& mesh, const std::vector<std::int32_t>& first)
      : begin_(first.size() + 1, 0), border_(first.size(), false) {
    const auto each_edge = [&](auto&& visit) {
      for (Index t = 0; t < mesh.triangles.rows(); ++t)
        for (int k = 0; k < 3; ++k) {
          const std::int32_t a = first[mesh.triangles(t, k)], b = first[mesh.triangles(t, (k + 1) % 3)];
          if (a != b) visit(a, b);
        }
    };
    each_edge([&](std::int32_t a, std::int32_t b) { ++begin_[a + 1], ++begin_[b + 1]; });
    for (std::size_t v = 0; v < first.size(); ++v) begin_[v + 1] += begin_[v];
    others_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    std::vector<std::int64_t> turn(first.size(), 0);  // 0 if a vertex's triangles form a closed fan
    each_edge([&](std::int32_t a, std::int32_t b) {
      others_[next[a]++] = b;
      others_[next[b]++] = a;
      turn[a] += b;
      turn[b] -= a;
    });
    for (std::size_t v = 0; v < first.size(); ++v) border_[v] = turn[v] != 0 || begin_[v] == begin_[v + 1];
  }
  Index size() const { return static_cast<Index>(border_.size()); }
  bool at_border(Index v) const { return border_[v]; }
  template <class Visit>
  void visit(Index v, Visit&& visit) const {
    for (std::size_t k = begin_[v]; k < begin_[v + 1]; ++k) visit(others_[k]);
  }

  /// The (negative umbrella) Laplacian: values (n,k) minus the means of their neighbours.
  template <class Values>
  Values differences(const Values& values) const {
    Values result = Values::Zero(values.rows(), values.cols());
    parallel_for(0, size(), 1024, [&](Index first, Index last) {
      for (Index v = first; v < last; ++v) {
        if (begin_[v] == begin_[v + 1]) continue;
        visit(v, [&](std::int32_t other) { result.row(v) += values.row(other); });
        result.row(v) = values.row(v) - result.row(v) / static_cast<double>(begin_[v + 1] - begin_[v]);
      }
    });
    return result;
  }

 private:
  std::vector<std::size_t> begin_;
  std::vector<std::int32_t> others_;
  std::vector<bool> border_;
};

/// Pairs of neighbours whose 1-rings do not touch a border.
std::vector<std::pair<std::int32_t, std::int32_t>> inner_pairs(const Neighbours& neighbours) {
  std::vector<bool> inner(neighbours.size());
  for (Index v = 0; v < neighbours.size(); ++v) {
    bool is_inner = !neighbours.at_border(v);
    neighbours.visit(v, [&](std::int32_t other) { is_inner = is_inner && !neighbours.at_border(other); });
    inner[v] = is_inner;
  }
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (Index v = 0; v < neighbours.size(); ++v)
    neighbours.visit(v, [&](std::int32_t other) {
      if (v < other && inner[v] && inner[other]) pairs.emplace_back(static_cast<std::int32_t>(v), other);
    });
  return pairs;
}

double median(std::vector<double> numbers) {
  const auto middle = numbers.begin() + static_cast<std::ptrdiff_t>(numbers.size() / 2);
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

/// Robust covariance of values over pairs, with outliers clamped.
double covariance(const Vector& values, const std::vector<std::pair<std::int32_t, std::int32_t>>& pairs) {
  std::vector<double> sizes;
  sizes.reserve(pairs.size());
  for (const auto& [a, b] : pairs) sizes.push_back(std::abs(values[a]));
  const double most = outlier * median(std::move(sizes));
  double sum = 0.0;
  for (const auto& [a, b] : pairs)
    sum += std::clamp(values[a], -most, most) * std::clamp(values[b], -most, most);
  return sum / static_cast<double>(pairs.size());
}

double noise_variance(const TriangleMesh& mesh, const WeldedVertices& welded, const Neighbours& neighbours) {
  const auto pairs = inner_pairs(neighbours);
  if (static_cast<Index>(pairs.size()) < enough_pairs) return 0.0;
  Points normals = welded.normals;
  for (int round = 0; round < normal_rounds; ++round) normals -= neighbours.differences(normals);
  normals = unit_rows(normals);
  const Vector first = neighbours.differences(mesh.vertices).cwiseProduct(normals).rowwise().sum();
  Vector unit(neighbours.size());
  Random random(0);
  for (double& value : unit) value = random.normal();
  unit = neighbours.differences(unit);
  const double by_first = covariance(first, pairs) / covariance(unit, pairs);
  const double by_second =
      covariance(neighbours.differences(first), pairs) / covariance(neighbours.differences(unit), pairs);
  const double variance = by_second - shape_share * std::max(0.0, by_second - by_first);
  return variance > 0.0 ? variance : 0.0;  // NaN of degenerate meshes too
}

}  // namespace

double vertex_noise(const TriangleMesh& mesh) {
  const WeldedVertices welded(mesh);
  return std::sqrt(noise_variance(mesh, welded, Neighbours(mesh, welded.first)));
}

Points without_noise(const TriangleMesh& mesh) {
  const WeldedVertices welded(mesh);
  const Neighbours neighbours(mesh, welded.first);
  const double variance = noise_variance(mesh, welded, neighbours), deviation = std::sqrt(variance);
  if (variance == 0.0) return mesh.vertices;
  Points smooth = mesh.vertices;
  for (int round = 0; round < smoothing_rounds; ++round)
    for (const double factor : {smoothing_step, -smoothing_back})
      smooth -= factor * neighbours.differences(smooth);
  Points moves = smooth - mesh.vertices;
  std::vector<double> along;
  for (Index v = 0; v < moves.rows(); ++v)
    if (welded.first[v] == v) along.push_back(std::abs(moves.row(v).dot(welded.normals.row(v))));
  if (!(median(std::move(along)) <= median_move * deviation)) return mesh.vertices;  // details, not noise
  const double diagonal = diagonal_of(mesh.vertices);
  const double share = variance / (variance + std::pow(harmless_noise * diagonal, 2));
  for (Index v = 0; v < moves.rows(); ++v)
    moves.row(v) *= share * std::min(1.0, most_move * deviation / std::max(moves.row(v).norm(), deviation));
  Points result = mesh.vertices + moves;
  for (Index v = 0; v < result.rows(); ++v) result.row(v) = result.row(welded.first[v]).eval();
  return result;
}

namespace {

using namespace wrap_parameters;

SurfaceSamples samples_of(const ImplicitFunction& function, Index count, std::uint64_t seed,
                          const Progress& progress) {
  if (const auto* mesh = dynamic_cast<const MeshSdf*>(&function))
    return sample_mesh(without_noise({mesh->vertices(), mesh->triangles()}), mesh->triangles(), count, seed);
  try {
    return sample_surface(
        function, {.count = static_cast<int>(count), .seed = static_cast<std::int64_t>(seed)}, progress);
  } catch (const InvalidInput& error) {
    throw InvalidInput(std::string("target: ") + error.what());
  }
}

/// Whether the directions to a point's neighbours leave no wide gap in its tangent plane.
bool is_interior(const WrapTarget& target, Index i) {
  const Vec3 point = target.points.row(i), normal = target.normals.row(i);
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<double> angles;
  for (const Index k : target.tree.within(point, neighbourhood_spacings * target.spacing)) {
    const Vec3 offset = target.points.row(k).transpose() - point;
    if (k == i || target.normals.row(k).dot(normal) < 0.0) continue;
    angles.push_back(std::atan2(offset.dot(v), offset.dot(u)));
  }
  if (angles.empty()) return false;
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2.0 * std::numbers::pi - angles.back();
  for (std::size_t k = 1; k < angles.size(); ++k) gap = std::max(gap, angles[k] - angles[k - 1]);
  return gap <= border_gap;
}

}  // namespace

Points Similarity::of(PointsIn points) const {
  return (points * (scale * rotation.transpose())).rowwise() + translation.transpose();
}

Points Similarity::inverse_of(PointsIn points) const {
  return (points.rowwise() - translation.transpose()) * (rotation / scale);
}

WrapTarget WrapTarget::transformed_back(const Similarity& placement) const {
  WrapTarget result;
  result.points = placement.inverse_of(points);
  result.normals = normals * placement.rotation;
  result.interior = interior;
  result.closed = closed;
  result.spacing = spacing / placement.scale;
  result.diagonal = diagonal / placement.scale;
  result.tree = OrientedPoints(result.points, result.normals);
  return result;
}

WrapTarget WrapTarget::subsample(Index count) const {
  const Index all = points.rows(), taken = std::min(count, all);
  WrapTarget result = *this;
  result.points = points.topRows(taken);
  result.normals = normals.topRows(taken);
  result.interior = interior.head(taken);
  if (curvature.values.size() > 0)
    result.curvature = {curvature.radius, curvature.values.topRows(taken),
                        curvature.gradients.topRows(taken)};
  result.spacing = spacing * std::sqrt(static_cast<double>(all) / static_cast<double>(taken));
  result.tree = OrientedPoints(result.points, result.normals);
  return result;
}

SurfaceCurvature curvature_of(const ImplicitFunction& function, const WrapTarget& target,
                              const Similarity& placement, std::uint64_t seed, const Progress& progress) {
  const SurfaceSamples samples = samples_of(function, curvature_samples, seed, progress);
  const Points points = placement.inverse_of(samples.frame.to_mesh(samples.points)),
               normals = samples.normals * placement.rotation;
  return curvature_at(points, normals, target.points, target.normals, curvature_radius * target.diagonal,
                      progress);
}

double mean_spacing(PointsIn points) {
  const Index n = points.rows(), taken = std::min(n, spacing_samples);
  if (n < 2) return 0.0;
  double sum = 0.0;
  for (Index k = 0; k < taken; ++k) {
    const Index i = k * n / taken;
    Vector squares = (points.rowwise() - points.row(i)).rowwise().squaredNorm();
    squares[i] = squares.maxCoeff();
    sum += std::sqrt(squares.minCoeff());
  }
  return 2.0 * sum / static_cast<double>(taken);  // random points' nearest neighbour is half a spacing away
}

WrapTarget wrap_target(const ImplicitFunction& function, Index count, std::uint64_t seed,
                       const Progress& progress) {
  const SurfaceSamples samples = samples_of(function, count, seed, progress);
  WrapTarget target;
  target.points = samples.frame.to_mesh(samples.points);
  target.normals = samples.normals;
  for (Index i = 0; i < target.normals.rows(); ++i)  // of triangles without area
    if (!(target.normals.row(i).squaredNorm() > 0.5)) target.normals.row(i) = Vec3::UnitZ().transpose();
  target.diagonal = diagonal_of(target.points);
  require(std::isfinite(target.points.squaredNorm()), "target", "its coordinates are too large",
          "their squares must be finite");
  target.spacing = mean_spacing(target.points);
  target.tree = OrientedPoints(target.points, target.normals);
  target.interior = Vector::Ones(target.points.rows());
  if (function.continuous()) return target;
  parallel_for(0, target.points.rows(), 256, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) target.interior[i] = is_interior(target, i) ? 1.0 : 0.0;
  });
  target.closed = false;
  progress.check();
  return target;
}

SurfaceDistances surface_distances(const OrientedPoints& tree, PointsIn points, PointsIn normals,
                                   double spacing, PointsIn queries, PointsIn query_normals,
                                   const Vector& areas, const Vector& interior) {
  const std::vector<Index> nearest = tree.nearest(queries, query_normals, 0.0);
  std::vector<std::pair<double, double>> distances;  // each with its area
  double area = 0.0, sum = 0.0;
  for (Index i = 0; i < queries.rows(); ++i) {
    const Index k = nearest[i];
    if (interior.size() > 0 && interior[k] == 0.0) continue;
    const Vec3 offset = queries.row(i) - points.row(k), normal = normals.row(k);
    const double across = offset.dot(normal);
    const double along = std::max(0.0, (offset - across * normal).norm() - spacing);
    distances.emplace_back(std::hypot(across, along), areas.size() > 0 ? areas[i] : 1.0);
    area += distances.back().second;
    sum += distances.back().first * distances.back().second;
  }
  SurfaceDistances result;
  if (!(area > 0.0)) return result;
  result.mean = sum / area;
  std::sort(distances.begin(), distances.end());
  double covered = 0.0;
  for (const auto& [distance, part] : distances) {
    result.quantile_95 = distance;
    if ((covered += part) >= 0.95 * area) break;
  }
  return result;
}

}  // namespace arapfields
