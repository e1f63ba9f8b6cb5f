// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/scan_noise.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/parallel.h"
#include "core/random.h"
#include "core/unit_rows.h"
#include "distance/welded_vertices.h"

namespace arapfields {
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

}  // namespace arapfields
