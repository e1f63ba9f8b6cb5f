// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/triangle_packet.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace arapfields {
namespace {

/// A triangle in its own plane, as TrianglePacket stores it.
struct Planar {
  Vec3 origin, x, y, z;
  double bx, cx, cy;
};

Vec3 any_perpendicular(const Vec3& unit) {
  int smallest = 0;
  unit.cwiseAbs().minCoeff(&smallest);
  return unit.cross(Vec3::Unit(smallest)).normalized();
}

/// The x axis is along the longest side: if a needle's plane is lost to rounding, no point of it moves by
/// more than the rounding error of that side.
Planar in_its_plane(const Vec3* v) {
  int start = 0;
  double longest = -1.0;
  for (int k = 0; k < 3; ++k) {
    const double length = (v[(k + 1) % 3] - v[k]).squaredNorm();
    if (length > longest) {
      longest = length;
      start = k;
    }
  }
  const Vec3 a = v[start], ab = v[(start + 1) % 3] - a, ac = v[(start + 2) % 3] - a;
  const double length = ab.norm();
  const Vec3 x = length > 0.0 ? Vec3(ab / length) : Vec3(Vec3::UnitX());
  const double along = x.dot(ac);
  const Vec3 across = ac - along * x;
  double height = across.norm();
  Vec3 y;
  if (height > 4.0 * std::numeric_limits<double>::epsilon() * length) {
    y = across / height;
    y = (y - y.dot(x) * x).normalized();
  } else {
    y = any_perpendicular(x);
    height = 0.0;
  }
  return {a, x, y, x.cross(y), length, along, height};
}

double inverse_square(double x, double y) {
  const double square = x * x + y * y;
  return square > 1e-300 ? 1.0 / square : 0.0;
}

void store(const Planar& planar, std::int32_t number, TrianglePacket& packet, int lane) {
  for (int k = 0; k < 3; ++k) {
    packet.origin[k][lane] = planar.origin[k];
    packet.axis_x[k][lane] = planar.x[k];
    packet.axis_y[k][lane] = planar.y[k];
    packet.axis_z[k][lane] = planar.z[k];
  }
  packet.bx[lane] = planar.bx;
  packet.cx[lane] = planar.cx;
  packet.cy[lane] = planar.cy;
  packet.inverse_ac[lane] = inverse_square(planar.cx, planar.cy);
  packet.inverse_bc[lane] = inverse_square(planar.bx - planar.cx, planar.cy);
  packet.triangle[lane] = number;
}

}  // namespace

void fill(TrianglePacket& packet, const Vec3* corners, const std::int32_t* numbers, int count) {
  for (int lane = 0; lane < count; ++lane) {
    store(in_its_plane(corners + 3 * lane), numbers[lane], packet, lane);
  }
  const Planar point{corners[0], Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(), 0.0, 0.0, 0.0};
  for (int lane = count; lane < tree_width; ++lane) store(point, numbers[0], packet, lane);
}

Vec3 closest_point(const TrianglePacket& p, int lane, const Vec3& point) {
  Vec3 origin, axis_x, axis_y;
  for (int k = 0; k < 3; ++k) {
    origin[k] = p.origin[k][lane];
    axis_x[k] = p.axis_x[k][lane];
    axis_y[k] = p.axis_y[k][lane];
  }
  const double x = axis_x.dot(point - origin), y = axis_y.dot(point - origin);
  const double bx = p.bx[lane], cx = p.cx[lane], cy = p.cy[lane], ex = cx - bx;
  const auto on_plane = [&](double u, double v) { return Vec3(origin + u * axis_x + v * axis_y); };
  if (y > 0.0 && x * cy - y * cx > 0.0 && y * ex - (x - bx) * cy > 0.0) return on_plane(x, y);
  const double ab = std::clamp(x, 0.0, bx);
  const double ac = std::clamp((x * cx + y * cy) * p.inverse_ac[lane], 0.0, 1.0);
  const double bc = std::clamp(((x - bx) * ex + y * cy) * p.inverse_bc[lane], 0.0, 1.0);
  const Eigen::Vector2d candidates[3] = {{ab, 0.0}, {ac * cx, ac * cy}, {bx + bc * ex, bc * cy}};
  const Eigen::Vector2d* best = candidates;
  for (const auto& candidate : candidates)
    if ((candidate - Eigen::Vector2d(x, y)).squaredNorm() < (*best - Eigen::Vector2d(x, y)).squaredNorm())
      best = &candidate;
  return on_plane(best->x(), best->y());
}

}  // namespace arapfields
