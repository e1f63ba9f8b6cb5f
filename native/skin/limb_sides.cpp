// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/limb_sides.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace arapfields {
namespace {

constexpr double endless = std::numeric_limits<double>::infinity();
/// Length, in sizes of the shape, over which the opposite side's influence vanishes where limbs separate.
constexpr double fade = 0.04;
/// Smaller influences are set to 0.
constexpr double least_share = 0.01;
/// Depth of a gap, in sizes of the shape, over which the influence falls to 0.
constexpr double gap_fade = 0.006;
/// Cosine of normals above which a point and the surface at the symmetry plane are one continuous sheet.
constexpr double sheet_cosine = 0.7;
/// Factor on the part of a bone's distance along the outward normal, against bones outside of the surface.
constexpr double outside = 3.0;
/// Least cosine of the normal at the symmetry plane with a limb's direction where it and its twin separate.
constexpr double facing_end = 0.5;

/// A chain or tree of bones on one side.
struct Limb {
  Vec3 along = Vec3::Zero();  ///< unit vector within the symmetry plane, towards the farthest end
  double parting = -endless;  ///< where along it the limb separates from its twin; −infinity: nowhere
};

/// The root bone of each bone's limb.
std::vector<Index> roots_of(const RigShape& rig) {
  std::vector<Index> roots;
  for (Index b = 0; b < rig.skeleton.count(); ++b) {
    Index root = b;
    for (Index up = b; up >= 0 && rig.sides[up] == rig.sides[b]; up = rig.skeleton.bone(up).parent) root = up;
    roots.push_back(root);
  }
  return roots;
}

/// The bone nearest to a place on the surface, by a distance that penalises bones on its outer side.
Index nearest_bone(const Skeleton& skeleton, const Vec3& place, const Vec3& normal) {
  double least = endless;
  Index result = 0;
  for (Index b = 0; b < skeleton.count(); ++b) {
    const Vec3 to = skeleton.nearest(b, place) - place;
    const double cost = to.norm() + outside * std::max(0.0, to.dot(normal));
    if (cost < least) least = cost, result = b;
  }
  return result;
}

/// The limbs, indexed by root bone.
std::vector<Limb> limbs_of(const RigShape& rig, const std::vector<Index>& roots, PointsIn surface) {
  std::vector<Limb> limbs(roots.size());
  for (std::size_t b = 0; b < roots.size(); ++b) {
    const Vec3 start = rig.skeleton.bone(roots[b]).head;
    for (const Vec3& end : {rig.skeleton.bone(b).head, rig.skeleton.bone(b).tail})
      if ((end - start).squaredNorm() > limbs[roots[b]].along.squaredNorm())
        limbs[roots[b]].along = end - start;
  }
  for (Limb& limb : limbs) {
    limb.along[rig.symmetry.axis] = 0.0;
    limb.along.normalize();
  }
  for (Index i = 0; i < surface.rows(); ++i) {
    if (std::abs(surface(i, rig.symmetry.axis) - rig.symmetry.offset) > rig.spacing) continue;
    const Index b = nearest_bone(rig.skeleton, surface.row(i), rig.samples.normals.row(i));
    if (rig.sides[b] == 0) continue;
    const Vec3 along = limbs[roots[b]].along;
    if (rig.samples.normals.row(i).dot(along) < facing_end) continue;
    for (const Index side : {b, rig.symmetry.mirrored[b]}) {
      Limb& limb = limbs[roots[side]];
      limb.parting = std::max(limb.parting, limb.along.dot(surface.row(i)));
    }
  }
  return limbs;
}

}  // namespace

LimbSides::LimbSides(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& near,
                     const RowMatrix<float>& distances)
    : sides(given.points.rows(), 0), shares(given.points.rows(), 1.0) {
  const Points &points = given.points, &normals = given.normals, &surface = rig.surface.points;
  if (std::ranges::all_of(rig.sides, [](int side) { return side == 0; })) return;
  const int axis = rig.symmetry.axis;
  const std::vector<Index> roots = roots_of(rig);
  const std::vector<Limb> limbs = limbs_of(rig, roots, surface);
  PiecePoints between{points, Points::Zero(points.rows(), 3), given.pieces};
  Points& middle = between.points;
  middle.col(axis).setConstant(rig.symmetry.offset);
  const std::vector<Index> nearest = rig.nearest_samples(between);
  for (Index i = 0; i < points.rows(); ++i) {
    // Parts that touch may lie across the plane: the owner's side counts.
    if (const int own_side = rig.sides[rig.owners[near[i]]]; rig.cuts_itself() && own_side != 0) {
      sides[i] = own_side;
      shares[i] = 0.0;
      continue;
    }
    const double beyond = points(i, axis) - rig.symmetry.offset;
    Index own = -1;
    for (Index b = 0; b < rig.skeleton.count(); ++b)
      if (rig.sides[b] * beyond > 0.0 && (own < 0 || distances(i, b) < distances(i, own))) own = b;
    if (own < 0) continue;
    // Depth of the gap: distance of the point's projection onto the symmetry plane outside of the shape.
    const Vec3 normal = rig.samples.normals.row(nearest[i]);
    const double gap = normal.dot(Vec3(middle.row(i) - surface.row(nearest[i])));
    const double closed = 1.0 - gap / (gap_fade * rig.extent);
    const Limb& limb = limbs[roots[own]];
    double open = closed;
    if (limb.parting > -endless) {
      const double same = (normals.row(i).dot(normal) - sheet_cosine) / (1.0 - sheet_cosine);
      open = std::max(1.0 + (limb.parting - limb.along.dot(points.row(i))) / (fade * rig.extent),
                      std::clamp(closed, 0.0, 1.0) * std::min(1.0, 2.0 * same));
    }
    open = std::clamp(open, 0.0, 1.0);
    sides[i] = rig.sides[own];
    const double share = open * open * (3.0 - 2.0 * open);
    shares[i] = share < least_share ? 0.0 : share;
  }
}

}  // namespace arapfields
