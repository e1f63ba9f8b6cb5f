// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <bitset>
#include <vector>

#include "core/types.h"
#include "fields/interior_distance.h"
#include "skin/skeleton.h"

namespace arapfields {

/// Points of a shape that may consist of several, possibly intersecting surfaces: body, hair, shoes.
struct PiecePoints {
  Points points;              ///< (n,3)
  Points normals;             ///< (n,3) unit length, outwards
  std::vector<Index> pieces;  ///< (n) index of each point's surface
  Index count() const;        ///< number of surfaces
};

/// For each point p with normal n the row of `others` (q, m) that minimises |p − q|² + turn² |n − m|². If a
/// surface has at least `enough` others, its points take one of them.
std::vector<Index> nearest_on_own(const PiecePoints& points, const PiecePoints& others, double turn,
                                  Index enough);

/// The owner bone of each node of a shape. Nodes of a surface that contains bones belong to the one of these
/// with the smallest interior distance; nodes of other surfaces belong to the owners of what they touch.
struct BoneRegions {
  /// The nodes are these samples, about `spacing` apart, and the graph's.
  /// Clips the skeleton's bones to the parts inside of the shape.
  BoneRegions(Skeleton& skeleton, const PiecePoints& surfaces, const std::vector<Index>& nodes,
              double spacing, const InteriorGraph& graph);

  /// Interior distances (n, bones) to each bone, by shortest paths in the graph; of bones that neither lie
  /// inside of the shape nor touch it a constant, larger than all.
  RowMatrix<float> distances(const InteriorGraph& graph) const;

  std::vector<Index> owner;      ///< (n) bone of each node
  std::vector<Index> own_bones;  ///< number of bones in each surface
  std::vector<bool> pulls;       ///< whether a bone lies inside of the shape or touches it
  RowMatrix<float> straight;     ///< (n, bones) Euclidean distances to the parts of the bones
};

/// Distances between bones along the skeleton's tree.
class BoneTree {
 public:
  explicit BoneTree(const Skeleton& skeleton);

  /// Whether a bone may influence points of the owner's region, at this distance from the bone.
  bool matters(Index bone, Index owner, double distance) const;

 private:
  Eigen::MatrixXi steps_;    // (bones, bones) edges of the path between two bones
  Eigen::MatrixXd between_;  // (bones, bones) total length of the bones on it
};

/// The visibility of surfaces from a place, by cube maps: a depth buffer and the covered directions of each.
class BoneSight {
  static constexpr int wide = 2;  // cells along an edge of the coarse cube map
  static constexpr int fine = 6;  // of the depth buffer

 public:
  static constexpr int all_sides = 6 * wide * wide;

  /// Renders the points whose surface has one of `count` slots; `slots` maps surfaces to slots, −1: none.
  BoneSight(const PiecePoints& surfaces, const std::vector<Index>& slots, Index count, const Vec3& place);

  /// Number of coarse cells (directions) that a surface covers.
  int sides(Index slot) const { return static_cast<int>(sides_[static_cast<std::size_t>(slot)].count()); }
  /// Whether a point is not occluded by its own surface; `tolerance` is a length.
  bool sees(const Vec3& point, Index slot, double tolerance) const;

 private:
  Vec3 place_;
  std::vector<std::bitset<all_sides>> sides_;
  std::vector<std::array<float, 6 * fine * fine>> depths_;
};

}  // namespace arapfields
