// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/carrier_frames.h"

#include <algorithm>
#include <cmath>

#include "core/memory.h"
#include "core/parallel.h"
#include "energies/rotation.h"
#include "fields/radial_basis.h"

namespace arapfields {
namespace {

/// Places for near and for far points, and how many of them a point goes along with.
/// More of them would let the nearest dominate; these few spread what lies between two legs over the way
/// between them. Distances, in sizes of the surface, up to which the first, and from which the others serve.
constexpr Index near_places = 256, far_places = 64, most_nearest = 48;
constexpr double near_distance = 0.05, far_distance = 0.1;

constexpr int row_length = 16;  // of a place: rotation − 1, offset, shift

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

struct Entry {
  Index place;
  double weight;
};

/// Adds the nearest of the first `count` places with weights that sum to `whole`.
void add_nearest(const Points& places, Index count, const Vec3& point, double whole,
                 std::vector<Entry>& entries) {
  count = std::min<Index>(count, places.rows());
  std::vector<std::pair<double, Index>> squares(at(count));
  for (Index i = 0; i < count; ++i) squares[at(i)] = {(places.row(i).transpose() - point).squaredNorm(), i};
  double outside = 0.0;  // 1/c²
  if (count > most_nearest) {
    std::nth_element(squares.begin(), squares.begin() + most_nearest, squares.end());
    outside = 1.0 / squares[at(most_nearest)].first;
    squares.resize(at(most_nearest));
  }
  std::sort(squares.begin(), squares.end());
  const std::size_t begin = entries.size();
  double total = 0.0;
  for (const auto& [square, place] : squares) {
    const double share = std::max(0.0, squares[0].first / square - squares[0].first * outside);
    entries.push_back({place, share * std::sqrt(share)});
    total += entries.back().weight;
  }
  const bool alike = !(total > 0.0);  // all at one distance
  for (std::size_t e = begin; e < entries.size(); ++e)
    entries[e].weight =
        whole * (alike ? 1.0 / static_cast<double>(squares.size()) : entries[e].weight / total);
}

}  // namespace

double smooth_between(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * t * (10.0 + t * (6.0 * t - 15.0));
}

CarrierFrames::CarrierFrames(PointsIn samples) {
  const FarthestPoints chosen = farthest_points(samples, near_places);
  places_ = samples(chosen.indices, Eigen::all);
}

CarriedPoints::CarriedPoints(const CarrierFrames& frames, PointsIn points, const Vector& distances,
                             double size)
    : points_(points) {
  constexpr double bytes = 2 * most_nearest * (sizeof(std::uint16_t) + sizeof(float));
  require_memory("points", bytes * static_cast<double>(points.rows()));
  choose(frames, distances, size);
}

void CarriedPoints::choose(const CarrierFrames& frames, const Vector& distances, double size) {
  const Points& places = frames.places();
  constexpr Index grain = 64;
  const Index n = points_.rows(), chunks = (n + grain - 1) / grain;
  middles_.resize(n, 3);
  std::vector<std::vector<Entry>> entries(at(chunks));
  std::vector<Index> counts(at(n));
  parallel_jobs(chunks, [&](Index chunk) {
    std::vector<Entry>& all = entries[at(chunk)];
    for (Index i = chunk * grain; i < std::min(n, (chunk + 1) * grain); ++i) {
      const double far = smooth_between(near_distance, far_distance, distances[i] / size);
      const std::size_t begin = all.size();
      if (far < 1.0) add_nearest(places, near_places, points_.row(i), 1.0 - far, all);
      if (far > 0.0) add_nearest(places, far_places, points_.row(i), far, all);
      counts[at(i)] = static_cast<Index>(all.size() - begin);
      Vec3 middle = Vec3::Zero();
      for (std::size_t e = begin; e < all.size(); ++e)
        middle += all[e].weight * places.row(all[e].place).transpose();
      middles_.row(i) = middle.transpose();
    }
  });
  start_.assign(1, 0);
  for (const Index count : counts) start_.push_back(start_.back() + count);
  nearest_.reserve(at(start_.back()));
  weights_.reserve(at(start_.back()));
  for (const auto& part : entries)
    for (const Entry& entry : part) {
      nearest_.push_back(static_cast<std::uint16_t>(entry.place));
      weights_.push_back(static_cast<float>(entry.weight));
    }
}

Points CarriedPoints::moved(const CarrierFrames& frames, PointsIn ends, const double* rotations) const {
  // Differences to the identity, which is then met exactly: x ↦ x + (R − 1) x + offset, and the shift.
  const Points& places = frames.places();
  const Index m = places.rows();
  std::vector<float> rows(at(m * row_length), 0.0f);
  for (Index j = 0; j < m; ++j) {
    Mat3 change;
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) change(i, k) = rotations[(k * m + j) * 3 + i] - (i == k ? 1.0 : 0.0);
    const Vec3 shift = (ends.row(j) - places.row(j)).transpose();
    const Vec3 offset = shift - change * places.row(j).transpose();
    float* row = &rows[at(j * row_length)];
    for (int k = 0; k < 9; ++k) row[k] = static_cast<float>(change(k % 3, k / 3));
    for (int k = 0; k < 3; ++k) row[9 + k] = static_cast<float>(offset[k]);
    for (int k = 0; k < 3; ++k) row[12 + k] = static_cast<float>(shift[k]);
  }
  Points result(points_.rows(), 3);
  parallel_for(0, points_.rows(), 1024, [&](Index first, Index last) {
    const Index count = last - first;
    std::vector<float> sums(at(count * row_length), 0.0f), mixed(at(9 * count)), turns(at(9 * count));
    for (Index p = 0; p < count; ++p) {
      float* sum = &sums[at(p * row_length)];
      for (Index e = start_[at(first + p)]; e < start_[at(first + p + 1)]; ++e) {
        const float* row = &rows[at(nearest_[at(e)] * row_length)];
        const float weight = weights_[at(e)];
        for (int k = 0; k < row_length; ++k) sum[k] += weight * row[k];
      }
      for (int k = 0; k < 9; ++k)
        mixed[at((k / 3 * count + p) * 3 + k % 3)] = sum[k] + (k % 4 == 0 ? 1.0f : 0.0f);
    }
    closest_rotations<float>(mixed.data(), count, turns.data());
    for (Index p = 0; p < count; ++p) {
      const Eigen::Map<const Eigen::Vector<float, row_length>> sum(&sums[at(p * row_length)]);
      const Vec3 point = points_.row(first + p), arm = point - middles_.row(first + p).transpose();
      Vec3 by_maps = sum.segment<3>(9).cast<double>(), by_places = sum.segment<3>(12).cast<double>();
      for (int k = 0; k < 3; ++k) {
        by_maps += sum.segment<3>(3 * k).cast<double>() * point[k];
        for (int i = 0; i < 3; ++i) {
          const float turn = turns[at((k * count + p) * 3 + i)];
          by_places[i] += (static_cast<double>(turn) - (i == k ? 1.0 : 0.0)) * arm[k];
        }
      }
      result.row(first + p) = (point + 0.5 * (by_maps + by_places)).transpose();
    }
  });
  return result;
}

}  // namespace arapfields
