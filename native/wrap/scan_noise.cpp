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

/// Rounds that average normals, which noise turns anywhere where it is larger than the edges.
constexpr int normal_rounds = 3;
/// Differences beyond so many times the usual one count as that.
constexpr double outlier = 3.7;
/// Pairs of neighbours that tell of noise, at least.
constexpr Index least_pairs = 500;
/// Of what first and second differences disagree by, what second differences of a shape itself have at most.
/// Source: clean meshes of 500 to 60,000 vertices; of 37 one coarse and shaggy one has more.
constexpr double shape_share = 0.35;
/// Noise, a share of the diagonal, of which a half is smoothed away.
constexpr double harmless_noise = 0.0003;
/// Rounds of smoothing, and the two steps of each: waves longer than about eight edges stay.
constexpr int smoothing_rounds = 20;
constexpr double smoothing_step = 0.5;
constexpr double smoothing_back = 0.52;
/// What smoothing moves along the normals, in deviations of the noise: the median at most, where it is noise
/// (0.7; 1.1 and more were seen on clean and coarse meshes with edges), and each vertex.
constexpr double median_move = 1.0, most_move = 4.0;

/// Each vertex's neighbours, once for each triangle that joins them; vertices at one place are one.
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
    std::vector<std::int64_t> turn(first.size(), 0);  // 0 where the triangles about a vertex close a fan
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

  /// Values (n,k) minus the means of their neighbours'.
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

/// Pairs of neighbours without a border near them.
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

/// Of pairs, with values far beyond the usual ones taken as `outlier` times those.
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
  if (static_cast<Index>(pairs.size()) < least_pairs) return 0.0;
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
  if (!(median(std::move(along)) <= median_move * deviation)) return mesh.vertices;  // it is the shape's own
  const double diagonal = diagonal_of(mesh.vertices);
  const double share = variance / (variance + std::pow(harmless_noise * diagonal, 2));
  for (Index v = 0; v < moves.rows(); ++v)
    moves.row(v) *= share * std::min(1.0, most_move * deviation / std::max(moves.row(v).norm(), deviation));
  Points result = mesh.vertices + moves;
  for (Index v = 0; v < result.rows(); ++v) result.row(v) = result.row(welded.first[v]).eval();
  return result;
}

}  // namespace arapfields
