// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/disk.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace arapfields {
namespace {

/// Half extent of a disk along a unit direction, by its cosine with the disk's normal.
double half_extent_along(double height, double radius, double cosine) {
  return height * std::abs(cosine) + radius * std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
}

}  // namespace

Disk disk_around(const Disk* parts, int count, const Vec3& direction) {
  Disk disk;
  const double length = direction.norm();
  if (length > 0.0) disk.normal = direction / length;
  Mat3 axes;  // rows: two tangents and the normal
  axes.row(0) = disk.normal.unitOrthogonal().transpose();
  axes.row(1) = disk.normal.cross(axes.row(0).transpose()).transpose();
  axes.row(2) = disk.normal.transpose();
  Vec3 low = Vec3::Constant(INFINITY), high = -low;
  for (int i = 0; i < count; ++i) {
    const Vec3 center = axes * parts[i].center, cosines = axes * parts[i].normal;
    for (int k = 0; k < 3; ++k) {
      const double extent = half_extent_along(parts[i].height, parts[i].radius, cosines[k]);
      low[k] = std::min(low[k], center[k] - extent);
      high[k] = std::max(high[k], center[k] + extent);
    }
  }
  const Vec3 middle = 0.5 * (low + high);
  disk.center = axes.transpose() * middle;
  disk.height = 0.5 * (high[2] - low[2]);
  for (int i = 0; i < count; ++i) {
    const double offset = (axes * parts[i].center - middle).head<2>().norm();
    const double cosine = disk.normal.dot(parts[i].normal);
    const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
    disk.radius = std::max(disk.radius, offset + parts[i].radius + parts[i].height * sine);
  }
  return disk;
}

void store(const Disk& disk, WideNode& node, int lane) {
  for (int k = 0; k < 3; ++k) {
    node.disk_center[k][lane] = static_cast<float>(disk.center[k]);
    node.disk_normal[k][lane] = static_cast<float>(disk.normal[k]);
  }
  node.disk_height[lane] = static_cast<float>(disk.height * (1.0 + 1e-6) + 1e-6);
  node.disk_radius[lane] = static_cast<float>(disk.radius * (1.0 + 1e-6) + 1e-6);
}

}  // namespace arapfields
