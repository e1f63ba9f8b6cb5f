// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// A bounding volume: a flat cylinder around a patch of the surface. It bounds distances far better than an
/// axis-aligned box on slanted patches, where boxes are thick and mostly empty.
struct Disk {
  Vec3 center = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();
  double height = 0.0;  ///< half of the cylinder's
  double radius = 0.0;
};

/// A disk around all parts, with its normal along `direction`, of any length, even zero. A point is a part
/// without height and radius.
Disk disk_around(const Disk* parts, int count, const Vec3& direction);

/// Writes a disk into one lane, enlarged by the possible rounding errors.
void store(const Disk& disk, WideNode& node, int lane);

}  // namespace arapfields
