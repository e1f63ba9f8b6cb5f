// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// A flat cylinder that holds a patch of the surface: on slanted patches, where boxes are thick and mostly
/// empty, it bounds distances far better.
struct Disk {
  Vec3 center = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();
  double height = 0.0;  ///< half of the cylinder's
  double radius = 0.0;
};

/// A disk about all parts, across a direction that need be neither of unit length nor different from zero.
/// A point is a part without height and radius.
Disk disk_around(const Disk* parts, int count, const Vec3& direction);

/// Writes a disk into one lane, enlarged by what rounding its numbers may have cost.
void store(const Disk& disk, WideNode& node, int lane);

}  // namespace arapfields
