// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/tricubic_surrogate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace arapfields {
namespace {

// Bound on |Φ − p| in a cell: the largest residual among its own and its neighbours' centres times the first,
// plus the largest third difference of its block times the second (creases may pass centres by). By the first
// alone at most 2 of 100,000 points exceed it on two published networks, 8 at creases of exact distances.
constexpr float error_safety = 3.0f;
constexpr float roughness_factor = 0.1f;
constexpr float error_floor = 1e-6f;  // rounding of float32 networks
// |∇(Φ − p)| against the largest of those residuals over the spacing. On four published networks the 99 %
// point along random directions is 2.3 to 5.5.
constexpr float slope_factor = 5.0f;
constexpr int max_rebuilds = 8;
constexpr double half_diagonal = 0.8660254037844386;  // √3/2, in spacings

/// Largest third difference along the four innermost grid lines of each axis.
float roughness(const CubicBlock& block) {
  float largest = 0.0f;
  for (int axis = 0; axis < 3; ++axis) {
    const int along = axis == 0 ? 16 : axis == 1 ? 4 : 1, u = axis == 0 ? 4 : 16, v = axis == 2 ? 4 : 1;
    for (int a = 1; a <= 2; ++a)
      for (int b = 1; b <= 2; ++b) {
        const float* n = block.node + a * u + b * v;
        largest = std::max(largest, std::abs(n[3 * along] - n[0] + 3.0f * (n[along] - n[2 * along])));
      }
  }
  return largest;
}

/// Largest difference of neighbours in a cube of `side`³ values.
double steepest(const VectorF& values, Index side) {
  float largest = 0.0f;
  for (const Index offset : {Index{1}, side, side * side})
    for (Index i = 0; i + offset < values.size(); ++i)
      if (i / offset % side + 1 < side) largest = std::max(largest, std::abs(values[i + offset] - values[i]));
  return largest;
}

}  // namespace

TricubicSurrogate::TricubicSurrogate(EvaluationCounter& function, const TricubicSurrogateOptions& options)
    : lipschitz_(function.gradient_bound() ? *function.gradient_bound() : measure_lipschitz(function)) {
  for (int attempt = 0; attempt < max_rebuilds; ++attempt) {
    cull(function, options);
    // Both signs, but no active cell: a continuous Φ is steeper between them than its sampled gradients.
    const bool steeper = active_.empty() && coarse_slope_ > lipschitz_ && function.continuous();
    if (steeper) lipschitz_ = coarse_slope_;
    if (!steeper && (!options.interpolate || fill(function))) break;
  }
  if (options.interpolate) measure_errors();
}

bool TricubicSurrogate::has_both_sides() const {
  const auto [low, high] = std::minmax_element(side_.begin(), side_.end());
  return *low < 0 && *high > 0;
}

std::array<int, 3> TricubicSurrogate::coordinates(Index cell) const {
  return {static_cast<int>(cell / (static_cast<Index>(cells_a_side_) * cells_a_side_)),
          static_cast<int>(cell / cells_a_side_ % cells_a_side_), static_cast<int>(cell % cells_a_side_)};
}

int TricubicSurrogate::position(double x) const {
  return std::clamp(static_cast<int>(std::floor((x + 1.0) / spacing())), 0, cells_a_side_ - 1);
}

int TricubicSurrogate::block_start(int position) const {
  return std::clamp(position - 1, 0, cells_a_side_ - 3);
}

float TricubicSurrogate::slope_error_of(float error) const {
  return slope_factor / error_safety * error / static_cast<float>(spacing());
}

Box TricubicSurrogate::bounds() const {
  Box box{Vec3::Constant(1.0), Vec3::Constant(-1.0)};
  for (const Index each : active_) {
    const auto place = coordinates(each);
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], place[axis] * spacing() - 1.0);
      box.high[axis] = std::max(box.high[axis], (place[axis] + 1) * spacing() - 1.0);
    }
  }
  return box;
}

CubicBlock TricubicSurrogate::block(Index cell) const {
  const auto place = coordinates(cell);
  const Index points = cells_a_side_ + 1, k = block_start(place[2]);
  CubicBlock result;
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < 4; ++b) {
      const Index row = (block_start(place[0]) + a) * points + block_start(place[1]) + b;
      std::copy_n(values_.data() + row * points + k, 4, result.node + 16 * a + 4 * b);
    }
  return result;
}

float TricubicSurrogate::operator()(const Vec3& point) const {
  const int i = position(point[0]), j = position(point[1]), k = position(point[2]);
  const double inverse = 1.0 / spacing();
  return block(cell(i, j, k))(static_cast<float>((point[0] + 1.0) * inverse - block_start(i)),
                              static_cast<float>((point[1] + 1.0) * inverse - block_start(j)),
                              static_cast<float>((point[2] + 1.0) * inverse - block_start(k)));
}

/// From coarse to fine: evaluates Φ at the centres of the remaining cells and keeps those whose value does
/// not exclude a zero.
void TricubicSurrogate::cull(EvaluationCounter& function, const TricubicSurrogateOptions& options) {
  cells_a_side_ = options.coarsest;
  side_.assign(Index{cells_a_side_} * cells_a_side_ * cells_a_side_, 0);
  active_.resize(side_.size());
  for (std::size_t i = 0; i < active_.size(); ++i) active_[i] = static_cast<Index>(i);
  for (;;) {
    PointsF centres(static_cast<Index>(active_.size()), 3);
    for (Index row = 0; row < centres.rows(); ++row) {
      const auto place = coordinates(active_[row]);
      for (int axis = 0; axis < 3; ++axis)
        centres(row, axis) = static_cast<float>((place[axis] + 0.5) * spacing() - 1.0);
    }
    const VectorF values = function.values(centres);
    if (cells_a_side_ == options.coarsest) coarse_slope_ = steepest(values, cells_a_side_) / spacing();
    const auto farthest_zero = static_cast<float>(lipschitz_ * half_diagonal * spacing());
    Index kept = 0;
    centre_values_.resize(values.size());
    for (Index row = 0; row < values.size(); ++row) {
      const Index each = active_[row];
      if (std::abs(values[row]) > farthest_zero) {
        side_[each] = values[row] > 0.0f ? 1 : -1;
      } else {
        centre_values_[kept] = values[row];
        active_[kept++] = each;
      }
    }
    active_.resize(kept);
    centre_values_.conservativeResize(kept);
    if (kept == 0 || kept >= options.target_cells || 2 * cells_a_side_ > options.max_cells_a_side) return;

    const int fine = 2 * cells_a_side_;
    std::vector<std::int8_t> inherited(8 * side_.size());
    active_.clear();
    Index child = 0;
    for (int i = 0; i < fine; ++i)
      for (int j = 0; j < fine; ++j)
        for (int k = 0; k < fine; ++k, ++child) {
          const int parent = side(cell(i / 2, j / 2, k / 2));
          inherited[child] = static_cast<std::int8_t>(parent);
          if (parent == 0) active_.push_back(child);
        }
    side_ = std::move(inherited);
    cells_a_side_ = fine;
  }
}

/// Evaluates Φ at the grid points of the active cells' blocks. False, with the bound on |∇Φ| raised, if two
/// neighbouring values differ by more than it allows.
bool TricubicSurrogate::fill(EvaluationCounter& function) {
  const Index points = cells_a_side_ + 1;
  const std::size_t total = points * points * points;
  std::vector<std::uint8_t> needed(total, 0);
  for (const Index each : active_) {
    const auto place = coordinates(each);
    for (Index a = 0; a < 4; ++a)
      for (Index b = 0; b < 4; ++b) {
        const Index row = (block_start(place[0]) + a) * points + block_start(place[1]) + b;
        std::fill_n(needed.begin() + row * points + block_start(place[2]), 4, std::uint8_t{1});
      }
  }
  std::vector<Index> list;
  for (std::size_t i = 0; i < total; ++i)
    if (needed[i]) list.push_back(static_cast<Index>(i));
  PointsF corners(static_cast<Index>(list.size()), 3);
  for (Index row = 0; row < corners.rows(); ++row) {
    const Index each = list[row];
    corners.row(row) << static_cast<float>(each / (points * points) * spacing() - 1.0),
        static_cast<float>(each / points % points * spacing() - 1.0),
        static_cast<float>(each % points * spacing() - 1.0);
  }
  const VectorF values = function.values(corners);
  values_.assign(total, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < list.size(); ++i) values_[list[i]] = values[i];

  float largest_difference = 0.0f;
  for (const Index each : list) {
    const auto at = [&](Index offset) { return values_[each + offset]; };
    // A comparison with NaN, a point that was not needed, is false and leaves `largest_difference` alone.
    if (each % points + 1 < points)
      largest_difference = std::max(largest_difference, std::abs(at(1) - at(0)));
    if (each / points % points + 1 < points)
      largest_difference = std::max(largest_difference, std::abs(at(points) - at(0)));
    if (each / (points * points) + 1 < points)
      largest_difference = std::max(largest_difference, std::abs(at(points * points) - at(0)));
  }
  const double slope = largest_difference / spacing();
  if (slope <= lipschitz_ * (1.0 + 1e-4) || function.gradient_bound() || !function.continuous()) return true;
  lipschitz_ = 1.25 * slope;
  return false;
}

int TricubicSurrogate::settled_sign(Index cell, const Vec3& point) const {
  const auto place = coordinates(cell);
  const Vec3 within = ((point.array() + 1.0) / spacing()).matrix() - Vec3(place[0], place[1], place[2]);
  const auto sign = [&](float value, const Vec3& from) {
    const bool kept = std::abs(value) > lipschitz_ * spacing() * (within - from).norm();
    return !kept ? 0 : value < 0.0f ? -1 : 1;
  };
  int result = sign(centre_[cell], Vec3::Constant(0.5));
  const Index points = cells_a_side_ + 1;
  for (int c = 0; c < 8 && result == 0; ++c) {
    const int i = c >> 2, j = (c >> 1) & 1, k = c & 1;
    const Index at = ((place[0] + i) * points + place[1] + j) * points + place[2] + k;
    result = sign(values_[at], Vec3(i, j, k));
  }
  return result;
}

/// Sets the active cells' errors by the residuals at their and their 26 neighbours' centres and the
/// roughness.
void TricubicSurrogate::measure_errors() {
  const auto count = static_cast<Index>(active_.size());
  error_.assign(side_.size(), 0.0f);
  centre_.assign(side_.size(), 0.0f);
  VectorF residual(count), rough(count);
  parallel_for(0, count, 512, [&](Index begin, Index end) {
    for (Index row = begin; row < end; ++row) {
      const auto place = coordinates(active_[row]);
      const CubicBlock nodes = block(active_[row]);
      float u[3];
      for (int axis = 0; axis < 3; ++axis)
        u[axis] = static_cast<float>(place[axis] - block_start(place[axis])) + 0.5f;
      rough[row] = roughness_factor * roughness(nodes) + error_floor;
      residual[row] = std::abs(nodes(u[0], u[1], u[2]) - centre_values_[row]);
    }
  });
  for (Index row = 0; row < count; ++row) {
    const float bound = error_safety * residual[row];
    const auto place = coordinates(active_[row]);
    centre_[active_[row]] = centre_values_[row];
    for (int i = std::max(place[0] - 1, 0); i <= std::min(place[0] + 1, cells_a_side_ - 1); ++i)
      for (int j = std::max(place[1] - 1, 0); j <= std::min(place[1] + 1, cells_a_side_ - 1); ++j)
        for (int k = std::max(place[2] - 1, 0); k <= std::min(place[2] + 1, cells_a_side_ - 1); ++k) {
          float& each = error_[cell(i, j, k)];
          each = std::max(each, bound);
        }
  }
  for (Index row = 0; row < count; ++row) error_[active_[row]] += rough[row];
}

}  // namespace arapfields
