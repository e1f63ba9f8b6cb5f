// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/task.h"
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

/// Integrals over some triangles with unit normals n, y = x − center:
/// N = ∫ n, Q = ∫ y nᵀ, T[k] = ∫ y yᵀ n_k (Barill et al. 2018, appendix A).
struct Multipole {
  Vec3 center = Vec3::Zero();
  double area = 0.0;
  double radius = 0.0;  ///< of a sphere about the center that holds the triangles
  Vec3 dipole = Vec3::Zero();
  Mat3 quadrupole = Mat3::Zero();
  std::array<Mat3, 3> octupole = {Mat3::Zero(), Mat3::Zero(), Mat3::Zero()};
};

/// The moments of triangles with corners corners[3 i + 0..2]; the center is their area-weighted centroid.
Multipole multipole_of(const Vec3* corners, int triangle_count);

/// The moments of the union of all parts.
Multipole multipole_of(const Multipole* parts, int count);

/// Writes the moments into one lane.
void store(const Multipole& multipole, NodeMoments& moments, int lane);
/// Makes a lane contribute nothing.
void store_nothing(NodeMoments& moments, int lane);

/// Fills a packet with 1 to 8 triangles: corners[3 i + 0..2] and the number of triangle i.
void fill(TrianglePacket& packet, const Vec3* corners, const std::int32_t* numbers, int count);

/// The point of the triangle in a packet's lane that is closest to `point`.
Vec3 closest_point(const TrianglePacket& packet, int lane, const Vec3& point);

/// A bounding-volume hierarchy over a triangle soup that serves both closest points and winding numbers.
/// Our own, since Eigen's KdBVH is binary, tests one box at a time and knows no moments: here a node has
/// eight children and a leaf eight triangles, each tested with a few vector instructions.
/// The tree depends on the mesh alone, not on the thread count.
class Hierarchy {
 public:
  /// The mesh must be valid (mesh/triangle_mesh.h). Throws InvalidInput where its extent is not finite.
  Hierarchy(PointsIn vertices, TrianglesIn triangles, const Progress& progress = {});

  HierarchyView view() const;
  /// Mesh coordinates → the centred and scaled ones of the hierarchy; the factor is a power of two.
  const Vec3& center() const { return center_; }
  double factor() const { return factor_; }
  Vec3 normalized(const Vec3& point) const { return (point - center_) * factor_; }
  Vec3 restored(const Vec3& point) const { return point / factor_ + center_; }

 private:
  Vec3 center_;
  double factor_ = 1.0;
  std::vector<WideNode> nodes_;
  std::vector<NodeMoments> moments_;
  std::unique_ptr<TrianglePacket[]> packets_;  // not a vector, which would zero them first
  std::int32_t packet_count_ = 0;
};

}  // namespace arapfields
