// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <numbers>

#include "distance/kernels.h"

namespace arapfields::SIMD_LEVEL {
namespace {

constexpr int W = tree_width;
constexpr double pi = std::numbers::pi;

/// atan2(y, x) to 1e-15. On [0, tan(π/8)] a minimax polynomial of atan(t)/t in t². Selections are factors 0
/// and 1: compilers turn conditions into branches, and then do not vectorise.
inline double arc_tangent(double y, double x) {
  const double ax = std::fabs(x), ay = std::fabs(y);
  const double swap = ax < ay ? 1.0 : 0.0, back = x < 0.0 ? 1.0 : 0.0;
  const double small = ax < ay ? ax : ay, large = ax < ay ? ay : ax;
  // Above tan(π/8): atan(t) = π/4 + atan((t − 1)/(t + 1)).
  const double steep = small > 0.41421356237309503 * large ? 1.0 : 0.0;
  const double t = (small - steep * large) / (large + steep * small + 1e-300);
  const double u = t * t;
  double p = -0.0253164795737764757;
  p = p * u + 0.0502476211894012803;
  p = p * u - 0.0650598296717083992;
  p = p * u + 0.0767353542818328602;
  p = p * u - 0.0908952995656230736;
  p = p * u + 0.111110488537512957;
  p = p * u - 0.142857126616847938;
  p = p * u + 0.199999999783926621;
  p = p * u - 0.33333333333221434;
  p = p * u + 0.999999999999999041;
  double angle = t * p + steep * (0.25 * pi);
  angle = swap * (0.5 * pi) + (1.0 - 2.0 * swap) * angle;
  angle = back * pi + (1.0 - 2.0 * back) * angle;
  return std::copysign(angle, y);
}

/// Adds each triangle's half solid angle seen from p (Van Oosterom and Strackee 1983), in its own plane's
/// coordinates, where the triple product is −z · bx · cy. Zero in that plane.
inline void add_half_angles(const TrianglePacket& t, const double* p, double* sums) {
  for (int i = 0; i < W; ++i) {
    const double dx = p[0] - t.origin[0][i], dy = p[1] - t.origin[1][i], dz = p[2] - t.origin[2][i];
    const double x = dx * t.axis_x[0][i] + dy * t.axis_x[1][i] + dz * t.axis_x[2][i];
    const double y = dx * t.axis_y[0][i] + dy * t.axis_y[1][i] + dz * t.axis_y[2][i];
    const double z = dx * t.axis_z[0][i] + dy * t.axis_z[1][i] + dz * t.axis_z[2][i];
    const double zz = z * z, xb = t.bx[i] - x, xc = t.cx[i] - x, yc = t.cy[i] - y;
    const double a = std::sqrt(x * x + y * y + zz), b = std::sqrt(xb * xb + y * y + zz);
    const double c = std::sqrt(xc * xc + yc * yc + zz);
    const double ab = y * y + zz - x * xb, bc = xb * xc - y * yc + zz, ca = zz - x * xc - y * yc;
    const double triple = -z * t.bx[i] * t.cy[i], sum = a * b * c + ab * c + bc * a + ca * b;
    sums[i] += (triple != 0.0 ? 1.0 : 0.0) * arc_tangent(triple, sum);
  }
}

/// Adds the multipole field of every child that is far enough, and its remainder; marks those children.
inline void add_far_fields(const NodeMoments& m, const float* q, float opening_squared, double* sums,
                           float* remainders, std::int32_t* is_far) {
  for (int i = 0; i < W; ++i) {
    const float rx = m.center[0][i] - q[0], ry = m.center[1][i] - q[1], rz = m.center[2][i] - q[2];
    const float squared = rx * rx + ry * ry + rz * rz;
    const float inverse = 1.0f / std::sqrt(squared + 1e-30f);
    const float x = rx * inverse, y = ry * inverse, z = rz * inverse;
    const float xx = x * x, yy = y * y, zz = z * z;
    const float dipole = m.dipole[0][i] * x + m.dipole[1][i] * y + m.dipole[2][i] * z;
    const float quadrupole = m.quadrupole[0][i] * (xx - zz) + m.quadrupole[1][i] * (yy - zz) +
                             m.quadrupole[2][i] * x * y + m.quadrupole[3][i] * x * z +
                             m.quadrupole[4][i] * y * z;
    const float octupole = m.octupole[0][i] * x * (xx - 3.0f * zz) + m.octupole[1][i] * y * (yy - 3.0f * zz) +
                           m.octupole[2][i] * y * (xx - zz) + m.octupole[3][i] * x * (yy - zz) +
                           m.octupole[4][i] * z * (3.0f * xx - zz) + m.octupole[5][i] * z * (3.0f * yy - zz) +
                           m.octupole[6][i] * x * y * z;
    const float field = ((octupole * inverse + quadrupole) * inverse + dipole) * inverse * inverse;
    const bool far = squared > opening_squared * m.radius_squared[i];
    const float spread = m.radius_squared[i] * inverse * inverse;
    const float remainder = m.area[i] * inverse * inverse * spread * spread;
    sums[i] += static_cast<double>(far ? field : 0.0f);
    remainders[i] += far ? remainder : 0.0f;
    is_far[i] = far ? 1 : 0;
  }
}

struct Winding {
  double number = 0.0, remainder = 0.0;
};

Winding winding_at(const HierarchyView& tree, const double* p, float opening_squared) {
  const float q[3] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  alignas(64) double fields[W] = {}, half_angles[W] = {};
  alignas(64) float remainders[W] = {};
  std::int32_t stack[stack_size];
  std::int32_t* top = stack;
  *top++ = 0;
  while (top != stack) {
    const std::int32_t index = *--top;
    if (index < 0) {
      add_half_angles(tree.packets[~index], p, half_angles);
      continue;
    }
    alignas(64) std::int32_t is_far[W];
    add_far_fields(tree.moments[index], q, opening_squared, fields, remainders, is_far);
    const WideNode& node = tree.nodes[index];
    for (int i = 0; i < node.count; ++i)
      if (is_far[i] == 0) *top++ = node.child[i];
  }
  Winding result;
  for (int i = 0; i < W; ++i) {
    result.number += fields[i] + half_angles[i] / (2.0 * pi);
    result.remainder += static_cast<double>(remainders[i]);
  }
  return result;
}

}  // namespace

void winding(const HierarchyView& tree, const double* points, std::int64_t count, double opening,
             double* numbers, double* remainders) {
  const float opening_squared = static_cast<float>(opening * opening);
  for (std::int64_t i = 0; i < count; ++i) {
    const double* p = points + 3 * i;
    // So far away the mesh is a speck, and single precision would overflow.
    const bool remote = std::fabs(p[0]) > 1e9 || std::fabs(p[1]) > 1e9 || std::fabs(p[2]) > 1e9;
    const Winding result = remote ? Winding{} : winding_at(tree, p, opening_squared);
    numbers[i] = result.number;
    if (remainders != nullptr) remainders[i] = result.remainder;
  }
}

}  // namespace arapfields::SIMD_LEVEL
