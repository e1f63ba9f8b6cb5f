// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/surface_frames.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "attach/frame_blend_kernel.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "energies/rotation.h"
#include "fields/radial_basis.h"

namespace arapfields {
namespace {

/// In sizes of the surface: the radius up to which each level but the last is used, the share of the radius
/// over which neighbouring levels blend, and the least distance in the weights.
constexpr std::array<double, 2> level_radius = {0.18, 0.32};
constexpr double overlap = 0.5, least_distance = 0.03;
/// The cutoff c in distances of the nearest frame; and the cutoff of nearby_means().
constexpr double weight_cutoff = 16.0, nearby_cutoff = 4.0;

struct Entry {
  Index frame;
  double weight;
};

/// The nonzero weights of a point's frames; their sum is 1.
class Weights {
 public:
  Weights(const SurfaceFrames& frames, double size, double cutoff)
      : frames_(frames), size_(size), cutoff_(cutoff) {}

  void add(const Vec3& point, double distance, std::vector<Entry>& entries) const {
    const Points& points = frames_.points();
    const double outside = 1.0 / square(cutoff_ * std::max(distance, least_distance * size_));
    const std::size_t begin = entries.size();
    double total = 0.0, least = std::numeric_limits<double>::infinity();
    Index nearest = 0;
    for (Index i = 0; i < points.rows(); ++i) {
      const double square = (points.row(i).transpose() - point).squaredNorm();
      if (square < least) least = square, nearest = i;
      const double kernel = 1.0 / std::max(square, tiny_square) - outside;
      const double area = kernel > 0.0 ? area_of(i, std::sqrt(square)) : 0.0;
      if (area > 0.0) entries.push_back({i, area * kernel * std::sqrt(kernel)});
      if (area > 0.0) total += entries.back().weight;
    }
    if (!(total > 0.0)) entries.resize(begin), entries.push_back({nearest, total = 1.0});
    for (std::size_t e = begin; e < entries.size(); ++e) entries[e].weight /= total;
  }

 private:
  static constexpr double tiny_square = 1e-24;
  static double square(double x) { return x * x; }

  /// The area that a frame at this distance represents, blended between levels.
  double area_of(Index frame, double distance) const {
    double area = 0.0, left = 1.0;
    for (std::size_t level = 0; level < SurfaceFrames::levels.size(); ++level) {
      const bool last = level + 1 == SurfaceFrames::levels.size();
      const double radius = last ? 0.0 : level_radius[level] * size_;
      const double beyond =
          last ? 0.0 : smooth_between((1.0 - overlap) * radius, (1.0 + overlap) * radius, distance);
      const Vector& areas = frames_.areas(level);
      if (frame < areas.size()) area += left * (1.0 - beyond) * areas[frame];
      left = beyond;
    }
    return area;
  }

  const SurfaceFrames& frames_;
  double size_, cutoff_;
};

}  // namespace

double smooth_between(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * t * (10.0 + t * (6.0 * t - 15.0));
}

SurfaceFrames::SurfaceFrames(PointsIn samples) {
  const FarthestPoints chosen = farthest_points(samples, levels.front());
  rows_.assign(chosen.indices.begin(), chosen.indices.end());
  points_ = samples(rows_, Eigen::all);
  // Each sample's nearest frame of each level; a coarser level is a prefix of the finest.
  const Index n = samples.rows();
  std::array<std::vector<Index>, levels.size()> nearest;
  for (auto& of_level : nearest) of_level.resize(n);
  parallel_for(0, n, 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      double least = std::numeric_limits<double>::infinity();
      Index closest = 0, level = static_cast<Index>(levels.size()) - 1;
      for (Index j = 0; j < points_.rows(); ++j) {
        for (; j == levels[level]; --level) nearest[level][i] = closest;
        const double square = (points_.row(j) - samples.row(i)).squaredNorm();
        if (square < least) least = square, closest = j;
      }
      for (; level >= 0; --level) nearest[level][i] = closest;
    }
  });
  for (std::size_t level = 0; level < levels.size(); ++level) {
    areas_[level] = Vector::Zero(std::min<Index>(levels[level], points_.rows()));
    for (const Index frame : nearest[level]) areas_[level][frame] += 1.0 / static_cast<double>(n);
  }
}

CarriedPoints::CarriedPoints(const SurfaceFrames& frames, PointsIn points, const Vector& distances,
                             double size)
    : points_(points), distances_(distances), size_(size) {
  constexpr double usual_entries = 150;
  constexpr double bytes = usual_entries * (sizeof(Entry) + sizeof(std::uint16_t) + sizeof(float));
  require_memory("points", bytes * static_cast<double>(points.rows()));
  compute_weights(frames);
}

void CarriedPoints::compute_weights(const SurfaceFrames& frames) {
  const Points& points = frames.points();
  constexpr Index grain = 64;
  const Index n = points_.rows(), chunks = (n + grain - 1) / grain;
  centers_.resize(n, 3);
  std::vector<std::vector<Entry>> entries(chunks);
  std::vector<std::int64_t> counts(n);
  const Weights weights(frames, size_, weight_cutoff);
  parallel_jobs(chunks, [&](Index chunk) {
    std::vector<Entry>& all = entries[chunk];
    for (Index i = chunk * grain; i < std::min(n, (chunk + 1) * grain); ++i) {
      const std::size_t begin = all.size();
      weights.add(points_.row(i), distances_[i], all);
      counts[i] = static_cast<std::int64_t>(all.size() - begin);
      Vec3 center = Vec3::Zero();
      for (std::size_t e = begin; e < all.size(); ++e)
        center += all[e].weight * points.row(all[e].frame).transpose();
      centers_.row(i) = center.transpose();
    }
  });
  start_.assign(1, 0);
  for (const std::int64_t count : counts) start_.push_back(start_.back() + count);
  frames_.reserve(start_.back());
  weights_.reserve(start_.back());
  for (const auto& part : entries)
    for (const Entry& entry : part) {
      frames_.push_back(static_cast<std::uint16_t>(entry.frame));
      weights_.push_back(static_cast<float>(entry.weight));
    }
}

Vector CarriedPoints::means(const Vector& values) const {
  Vector result(points_.rows());
  parallel_for(0, points_.rows(), 1024, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      double sum = 0.0;
      for (std::int64_t e = start_[i]; e < start_[i + 1]; ++e)
        sum += static_cast<double>(weights_[e]) * values[frames_[e]];
      result[i] = sum;
    }
  });
  return result;
}

Vector CarriedPoints::nearby_means(const SurfaceFrames& frames, const Vector& values) const {
  const Weights weights(frames, size_, nearby_cutoff);
  Vector means = Vector::Zero(points_.rows());
  parallel_for(0, points_.rows(), 64, [&](Index first, Index last) {
    std::vector<Entry> entries;
    for (Index i = first; i < last; ++i) {
      entries.clear();
      weights.add(points_.row(i), distances_[i], entries);
      for (const Entry& entry : entries) means[i] += entry.weight * values[entry.frame];
    }
  });
  return means;
}

Points CarriedPoints::moved(const SurfaceFrames& frames, PointsIn positions, const double* rotations,
                            const Vector& growth) const {
  // Differences to the identity, so that it is reproduced exactly: x ↦ x + (s R − 1) x + offset, and the
  // shift.
  const Points& points = frames.points();
  const Index m = points.rows();
  std::vector<float> rows(m * frame_length, 0.0f);
  for (Index j = 0; j < m; ++j) {
    const double size = growth.size() > 0 ? growth[j] : 1.0;
    Mat3 change;
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) change(i, k) = size * rotations[(k * m + j) * 3 + i] - (i == k ? 1.0 : 0.0);
    const Vec3 shift = (positions.row(j) - points.row(j)).transpose();
    const Vec3 offset = shift - change * points.row(j).transpose();
    float* row = &rows[j * frame_length];
    for (int k = 0; k < 9; ++k) row[k] = static_cast<float>(change(k % 3, k / 3));
    for (int k = 0; k < 3; ++k) row[9 + k] = static_cast<float>(offset[k]);
    for (int k = 0; k < 3; ++k) row[12 + k] = static_cast<float>(shift[k]);
    row[15] = static_cast<float>(size - 1.0);
  }
  Points result(points_.rows(), 3);
  parallel_for(0, points_.rows(), 1024, [&](Index first, Index last) {
    const Index count = last - first;
    std::vector<float> sums(count * frame_length), blended(9 * count), rotations_of(9 * count);
    ARAPFIELDS_DISPATCH(blend_frames(rows.data(), start_.data() + first, frames_.data(), weights_.data(),
                                     count, sums.data()));
    for (Index p = 0; p < count; ++p)
      for (int k = 0; k < 9; ++k)
        blended[(k / 3 * count + p) * 3 + k % 3] = sums[p * frame_length + k] + (k % 4 == 0 ? 1.0f : 0.0f);
    closest_rotations<float>(blended.data(), count, rotations_of.data());
    for (Index p = 0; p < count; ++p) {
      const Eigen::Map<const Eigen::Vector<float, frame_length>> sum(&sums[p * frame_length]);
      const Vec3 point = points_.row(first + p), arm = point - centers_.row(first + p).transpose();
      Vec3 by_maps = sum.segment<3>(9).cast<double>(), by_positions = sum.segment<3>(12).cast<double>();
      for (int k = 0; k < 3; ++k) {
        by_maps += sum.segment<3>(3 * k).cast<double>() * point[k];
        for (int i = 0; i < 3; ++i) {
          const double turn = (1.0 + static_cast<double>(sum[15])) * rotations_of[(k * count + p) * 3 + i];
          by_positions[i] += (turn - (i == k ? 1.0 : 0.0)) * arm[k];
        }
      }
      result.row(first + p) = (point + 0.5 * (by_maps + by_positions)).transpose();
    }
  });
  return result;
}

}  // namespace arapfields
