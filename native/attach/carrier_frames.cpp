// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/carrier_frames.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "attach/carrier_kernel.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "energies/rotation.h"
#include "fields/radial_basis.h"

namespace arapfields {
namespace {

/// In sizes of the surface: how far each level of places but the last reaches, half of which and half as far
/// again it shares with the next one; and the least distance from which weights are counted.
constexpr std::array<double, 2> level_reach = {0.18, 0.32};
constexpr double overlap = 0.5, least_distance = 0.03;
/// c in distances of the nearest place: what is farther away has no part; and for what is close by.
constexpr double reach_of_weights = 16.0, close_by = 4.0;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

struct Entry {
  Index place;
  double weight;
};

/// The weights of all places that have one for a point, the sum of which is 1.
class Weights {
 public:
  Weights(const CarrierFrames& frames, double size, double reach)
      : frames_(frames), size_(size), reach_(reach) {}

  void add(const Vec3& point, double distance, std::vector<Entry>& entries) const {
    const Points& places = frames_.places();
    const double outside = 1.0 / square(reach_ * std::max(distance, least_distance * size_));
    const std::size_t begin = entries.size();
    double total = 0.0, least = std::numeric_limits<double>::infinity();
    Index nearest = 0;
    for (Index i = 0; i < places.rows(); ++i) {
      const double away = (places.row(i).transpose() - point).squaredNorm();
      if (away < least) least = away, nearest = i;
      const double share = 1.0 / std::max(away, tiny_square) - outside;
      const double area = share > 0.0 ? area_of(i, std::sqrt(away)) : 0.0;
      if (area > 0.0) entries.push_back({i, area * share * std::sqrt(share)});
      if (area > 0.0) total += entries.back().weight;
    }
    if (!(total > 0.0)) entries.resize(begin), entries.push_back({nearest, total = 1.0});
    for (std::size_t e = begin; e < entries.size(); ++e) entries[e].weight /= total;
  }

 private:
  static constexpr double tiny_square = 1e-24;
  static double square(double x) { return x * x; }

  /// The area for which a place at this distance stands: that of the levels which serve there.
  double area_of(Index place, double distance) const {
    double area = 0.0, left = 1.0;
    for (std::size_t level = 0; level < CarrierFrames::levels.size(); ++level) {
      const bool last = level + 1 == CarrierFrames::levels.size();
      const double reach = last ? 0.0 : level_reach[level] * size_;
      const double beyond =
          last ? 0.0 : smooth_between((1.0 - overlap) * reach, (1.0 + overlap) * reach, distance);
      const Vector& areas = frames_.areas(level);
      if (place < areas.size()) area += left * (1.0 - beyond) * areas[place];
      left = beyond;
    }
    return area;
  }

  const CarrierFrames& frames_;
  double size_, reach_;
};

}  // namespace

double smooth_between(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * t * (10.0 + t * (6.0 * t - 15.0));
}

CarrierFrames::CarrierFrames(PointsIn samples) {
  const FarthestPoints chosen = farthest_points(samples, levels.front());
  places_ = samples(chosen.indices, Eigen::all);
  // The sample's nearest place of each level; the coarser levels are the first places.
  const Index n = samples.rows();
  std::array<std::vector<Index>, levels.size()> nearest;
  for (auto& of_level : nearest) of_level.resize(at(n));
  parallel_for(0, n, 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      double least = std::numeric_limits<double>::infinity();
      Index found = 0, level = static_cast<Index>(levels.size()) - 1;
      for (Index j = 0; j < places_.rows(); ++j) {
        for (; j == levels[at(level)]; --level) nearest[at(level)][at(i)] = found;
        const double away = (places_.row(j) - samples.row(i)).squaredNorm();
        if (away < least) least = away, found = j;
      }
      for (; level >= 0; --level) nearest[at(level)][at(i)] = found;
    }
  });
  for (std::size_t level = 0; level < levels.size(); ++level) {
    areas_[level] = Vector::Zero(std::min<Index>(levels[level], places_.rows()));
    for (const Index place : nearest[level]) areas_[level][place] += 1.0 / static_cast<double>(n);
  }
}

CarriedPoints::CarriedPoints(const CarrierFrames& frames, PointsIn points, const Vector& distances,
                             double size)
    : points_(points), distances_(distances), size_(size) {
  constexpr double usual_entries = 150;
  constexpr double bytes = usual_entries * (sizeof(Entry) + sizeof(std::uint16_t) + sizeof(float));
  require_memory("points", bytes * static_cast<double>(points.rows()));
  choose(frames);
}

void CarriedPoints::choose(const CarrierFrames& frames) {
  const Points& places = frames.places();
  constexpr Index grain = 64;
  const Index n = points_.rows(), chunks = (n + grain - 1) / grain;
  middles_.resize(n, 3);
  std::vector<std::vector<Entry>> entries(at(chunks));
  std::vector<std::int64_t> counts(at(n));
  const Weights weights(frames, size_, reach_of_weights);
  parallel_jobs(chunks, [&](Index chunk) {
    std::vector<Entry>& all = entries[at(chunk)];
    for (Index i = chunk * grain; i < std::min(n, (chunk + 1) * grain); ++i) {
      const std::size_t begin = all.size();
      weights.add(points_.row(i), distances_[i], all);
      counts[at(i)] = static_cast<std::int64_t>(all.size() - begin);
      Vec3 middle = Vec3::Zero();
      for (std::size_t e = begin; e < all.size(); ++e)
        middle += all[e].weight * places.row(all[e].place).transpose();
      middles_.row(i) = middle.transpose();
    }
  });
  start_.assign(1, 0);
  for (const std::int64_t count : counts) start_.push_back(start_.back() + count);
  places_.reserve(at(start_.back()));
  weights_.reserve(at(start_.back()));
  for (const auto& part : entries)
    for (const Entry& entry : part) {
      places_.push_back(static_cast<std::uint16_t>(entry.place));
      weights_.push_back(static_cast<float>(entry.weight));
    }
}

Vector CarriedPoints::means_close_by(const CarrierFrames& frames, const Vector& values) const {
  const Weights weights(frames, size_, close_by);
  Vector means = Vector::Zero(points_.rows());
  parallel_for(0, points_.rows(), 64, [&](Index first, Index last) {
    std::vector<Entry> entries;
    for (Index i = first; i < last; ++i) {
      entries.clear();
      weights.add(points_.row(i), distances_[i], entries);
      for (const Entry& entry : entries) means[i] += entry.weight * values[entry.place];
    }
  });
  return means;
}

Points CarriedPoints::moved(const CarrierFrames& frames, PointsIn ends, const double* rotations) const {
  // Differences to the identity, which is then met exactly: x ↦ x + (R − 1) x + offset, and the shift.
  const Points& places = frames.places();
  const Index m = places.rows();
  std::vector<float> rows(at(m * frame_length), 0.0f);
  for (Index j = 0; j < m; ++j) {
    Mat3 change;
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) change(i, k) = rotations[(k * m + j) * 3 + i] - (i == k ? 1.0 : 0.0);
    const Vec3 shift = (ends.row(j) - places.row(j)).transpose();
    const Vec3 offset = shift - change * places.row(j).transpose();
    float* row = &rows[at(j * frame_length)];
    for (int k = 0; k < 9; ++k) row[k] = static_cast<float>(change(k % 3, k / 3));
    for (int k = 0; k < 3; ++k) row[9 + k] = static_cast<float>(offset[k]);
    for (int k = 0; k < 3; ++k) row[12 + k] = static_cast<float>(shift[k]);
  }
  Points result(points_.rows(), 3);
  parallel_for(0, points_.rows(), 1024, [&](Index first, Index last) {
    const Index count = last - first;
    std::vector<float> sums(at(count * frame_length)), mixed(at(9 * count)), turns(at(9 * count));
    ARAPFIELDS_DISPATCH(blend_frames(rows.data(), start_.data() + first, places_.data(), weights_.data(),
                                     count, sums.data()));
    for (Index p = 0; p < count; ++p)
      for (int k = 0; k < 9; ++k)
        mixed[at((k / 3 * count + p) * 3 + k % 3)] =
            sums[at(p * frame_length + k)] + (k % 4 == 0 ? 1.0f : 0.0f);
    closest_rotations<float>(mixed.data(), count, turns.data());
    for (Index p = 0; p < count; ++p) {
      const Eigen::Map<const Eigen::Vector<float, frame_length>> sum(&sums[at(p * frame_length)]);
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
