// SPDX-License-Identifier: GPL-3.0-or-later
// Plain memory layout of the triangle hierarchy, shared by the kernels of every instruction set.
#pragma once

#include <cstdint>

namespace arapfields {

/// Children of a node and triangles of a leaf: one vector of doubles, or half of one of floats, in AVX-512.
constexpr int tree_width = 8;

/// Bounding boxes and disks (distance/hierarchy.h) of up to eight children, rounded outwards to single
/// precision, coordinate by coordinate. child ≥ 0 is a node, child < 0 the packet ~child. Unused lanes come
/// last.
struct alignas(64) WideNode {
  float low[3][tree_width];
  float high[3][tree_width];
  float disk_center[3][tree_width];
  float disk_normal[3][tree_width];
  float disk_height[tree_width];
  float disk_radius[tree_width];
  std::int32_t child[tree_width];
  std::int32_t count;
};

/// Multipole moments of each child's field of solid angles, up to the octupole (Barill et al. 2018, "Fast
/// Winding Numbers for Soups and Clouds", eq. 12), with the trace, which does not affect the field, removed
/// and all factors multiplied in: w(q) ≈ N·e/R² + Q(e,e)/R³ + S(e,e,e)/R⁴ with r = center − q = R e.
struct alignas(64) NodeMoments {
  float center[3][tree_width];
  float radius_squared[tree_width];  ///< of a sphere about the center that holds the child
  float area[tree_width];            ///< of the child's triangles, over 4π
  float dipole[3][tree_width];       ///< N
  float quadrupole[5][tree_width];   ///< Q: xx, yy, 2 xy, 2 xz, 2 yz (zz = −xx − yy)
  float octupole[7][tree_width];     ///< S: xxx, yyy, 3 xxy, 3 xyy, xxz, yyz, 6 xyz
};

/// Eight triangles, each in a frame of its own: corners (0,0), (bx,0), (cx,cy) in the plane of the
/// orthonormal axes, bx ≥ 0, cy ≥ 0; normal toward the side from which the corners go counter-clockwise.
/// Unused lanes hold the first triangle's origin as a point, under the first triangle's number.
struct alignas(64) TrianglePacket {
  double origin[3][tree_width];
  double axis_x[3][tree_width];
  double axis_y[3][tree_width];
  double axis_z[3][tree_width];
  double bx[tree_width], cx[tree_width], cy[tree_width];
  double inverse_ac[tree_width], inverse_bc[tree_width];  ///< 1 / squared length; 0 for a point
  std::int32_t triangle[tree_width];
};

/// The hierarchy as kernels see it. Coordinates are centred and scaled so that the box fits [-1,1]³.
struct HierarchyView {
  const WideNode* nodes;  ///< the root is the first
  const NodeMoments* moments;
  const TrianglePacket* packets;
  std::int32_t packet_count;
};

struct Nearest {
  double squared_distance;
  std::int32_t triangle;  ///< of several at the same distance the first
  std::int32_t packet;
};

/// Levels of splitting after which ranges are halved, and the largest stack of a traversal.
constexpr int skewed_split_levels = 40;
constexpr int stack_size = (skewed_split_levels + 32) * (tree_width - 1) + 1;

}  // namespace arapfields
