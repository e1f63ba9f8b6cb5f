// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "core/task.h"
#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

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
