// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "fields/field.h"

namespace arapfields {

/// A region that moves rigidly (or affinely, if its handle may scale), in cube coordinates: the box
/// {placement·u, u ∈ [-1,1]³}, a point if its linear part is 0, and the motion x ↦ C x from rest to target.
struct RigidRegion {
  Mat4 placement = Mat4::Identity();
  Mat4 motion = Mat4::Identity();
  double margin = 0.1;  ///< width of the fall-off outside the box
  std::string name;     ///< for messages
};

/// Interpolates rigid motions. Region i has a C³ weight w_i that is 1 in its box and falls to 0 over its
/// margin; earlier regions have priority,
///   h(x) = x + Σ_i W_i (C_i x − x),  W_i = w_i Π_{j<i} (1 − w_j),
/// so that h is exact in each box that no earlier region's margin reaches (see limit_margins).
/// A trainable part multiplied by free_weight() = Π_i (1 − w_i) vanishes in all boxes, and so keeps h exact.
class HandleBlend final : public DeformationField {
 public:
  /// Throws InvalidInput for a margin that is not positive or a box that is flat or sheared.
  explicit HandleBlend(std::vector<RigidRegion> regions);
  /// Jets of h.
  void evaluate(PointsIn points, JetView<double> out) const override;
  /// Jets (columns, n) of Π (1 − w_i), one column after the other, at points (n,3).
  void free_weight(PointsIn points, JetOrder order, double* out) const;
  /// Chebyshev distance of a point from region i's box, in the box's directions; ≤ 0 inside.
  double distance(Index region, const Vec3& point) const;
  const std::vector<RigidRegion>& regions() const { return regions_; }

 private:
  struct OrientedBox {
    Mat3 directions;  ///< rows: unit directions of the box's edges
    Vec3 center, half_extents;
  };
  template <class Consume>
  void for_each_point(PointsIn points, Consume&& consume) const;

  std::vector<RigidRegion> regions_;
  std::vector<OrientedBox> boxes_;
};

/// Shrinks margins until no region's fall-off reaches points of a later one that it would move differently;
/// `members[i]` are region i's points (cube coordinates). Returns one sentence for each margin shrunk. Throws
/// InvalidInput naming two regions that share such a point or are closer to one than 0.001.
std::vector<std::string> limit_margins(std::vector<RigidRegion>& regions, const std::vector<Points>& members);

}  // namespace arapfields
