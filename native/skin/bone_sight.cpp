// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_sight.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace arapfields {
namespace {

/// A point is occluded if it is farther than this multiple of the depth in its direction.
constexpr double hidden = 1.2;

/// The cell of a cube map, with count × count cells a face, in a direction.
std::size_t cell_of(const Vec3& direction, int count) {
  int axis = 0;
  const double most = direction.cwiseAbs().maxCoeff(&axis);
  const auto at = [&](double x) {
    return std::clamp(static_cast<int>((0.5 + 0.5 * x / most) * count), 0, count - 1);
  };
  const int face = 2 * axis + (direction[axis] < 0.0 ? 1 : 0);
  return static_cast<std::size_t>((face * count + at(direction[(axis + 1) % 3])) * count +
                                  at(direction[(axis + 2) % 3]));
}

}  // namespace

BoneSight::BoneSight(const PiecePoints& surfaces, const std::vector<Index>& slots, Index count,
                     const Vec3& place)
    : place_(place), sides_(count), depths_(count) {
  for (auto& each : depths_) each.fill(std::numeric_limits<float>::infinity());
  for (Index i = 0; i < surfaces.points.rows(); ++i) {
    const Vec3 direction = surfaces.points.row(i).transpose() - place;
    const double distance = direction.norm();
    const Index slot = slots[surfaces.pieces[i]];
    if (slot < 0 || !(distance > 0.0)) continue;
    sides_[slot][cell_of(direction, wide)] = true;
    float& depth = depths_[slot][cell_of(direction, fine)];
    depth = std::min(depth, static_cast<float>(distance));
  }
}

bool BoneSight::sees(const Vec3& point, Index slot, double tolerance) const {
  const Vec3 direction = point - place_;
  const double distance = direction.norm();
  if (!(distance > 0.0)) return true;
  const auto depth = static_cast<double>(depths_[static_cast<std::size_t>(slot)][cell_of(direction, fine)]);
  return distance <= hidden * depth + tolerance;
}

}  // namespace arapfields
