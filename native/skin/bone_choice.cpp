// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_choice.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/decompositions.h"
#include "core/smoothstep.h"

namespace arapfields {
namespace {

/// Penalty weight of the constraint Σ w = 1, relative to H's mean diagonal.
constexpr double sum_weight = 10.0;

/// argmin of wᵀHw/2 − gᵀw over w ≥ 0 (Lawson, Hanson 1974, chapter 23, on the normal equations).
FewBones non_negative(const BonePairs& h, const FewBones& g) {
  const Index n = g.size();
  FewBones w = FewBones::Zero(n);
  std::vector<Index> free;
  const auto solve_free = [&] {
    BonePairs part(free.size(), free.size());
    FewBones right(free.size());
    for (std::size_t i = 0; i < free.size(); ++i) {
      right[i] = g[free[i]];
      for (std::size_t j = 0; j < free.size(); ++j) part(i, j) = h(free[i], free[j]);
    }
    return FewBones(part.ldlt().solve(right));
  };
  for (Index round = 0; round < 3 * n; ++round) {
    const FewBones dual = g - h * w;
    Index entering = -1;
    for (Index i = 0; i < n; ++i)
      if (std::ranges::find(free, i) == free.end() &&
          dual[i] > 1e-10 * std::max(1.0, g.cwiseAbs().maxCoeff()) &&
          (entering < 0 || dual[i] > dual[entering]))
        entering = i;
    if (entering < 0) break;
    free.push_back(entering);
    while (!free.empty()) {
      const FewBones next = solve_free();
      double step = 1.0;
      for (std::size_t i = 0; i < free.size(); ++i)
        if (next[i] <= 0.0) step = std::min(step, w[free[i]] / std::max(w[free[i]] - next[i], 1e-300));
      for (std::size_t i = 0; i < free.size(); ++i) w[free[i]] += step * (next[i] - w[free[i]]);
      if (step >= 1.0) break;
      std::erase_if(free, [&](Index i) {
        if (w[i] > 1e-12) return false;
        w[i] = 0.0;
        return true;
      });
    }
  }
  return w;
}

std::vector<Index> positive(const FewBones& w) {
  std::vector<Index> result;
  for (Index i = 0; i < w.size(); ++i)
    if (w[i] > 0.0) result.push_back(i);
  return result;
}

/// The used weight whose removal increases the objective least, w_j² / (H⁻¹)_jj, with the others adapted
/// (Hassibi, Stork 1993).
Index cheapest(const BonePairs& h, const FewBones& w, const std::vector<Index>& used) {
  Eigen::MatrixXd part = h(used, used);
  part.diagonal().array() *= 1.0 + 1e-12;
  const auto n = static_cast<Index>(used.size());
  const Eigen::MatrixXd inverse = solve_definite(part, Eigen::MatrixXd::Identity(n, n));
  Index best = used.front();
  double least = std::numeric_limits<double>::infinity();
  for (Index j = 0; j < n; ++j) {
    const double loss = w[used[j]] * w[used[j]] / std::max(inverse(j, j), 1e-300);
    if (loss < least) least = loss, best = used[j];
  }
  return best;
}

}  // namespace

FewBones simplex_minimum(const BonePairs& h, const FewBones& g, int influences) {
  const Index k = g.size();
  if (k == 1) return FewBones::Ones(1);
  const double scale = sum_weight * h.diagonal().mean();
  BonePairs square = (h.array() + scale) / scale;
  FewBones right = (g.array() + scale) / scale;
  FewBones w = non_negative(square, right);
  for (;;) {
    const std::vector<Index> used = positive(w);
    if (static_cast<int>(used.size()) <= influences) break;
    const Index leaving = cheapest(square, w, used);  // fixed at 0 from now on
    square.row(leaving).setZero();
    square.col(leaving).setZero();
    square(leaving, leaving) = 1.0;
    right[leaving] = 0.0;
    w = non_negative(square, right);
  }
  return w / w.sum();
}

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
    sides[i] = rig.sides[own];
    const double share = smoothstep(0.0, 1.0, open);
    shares[i] = share < least_share ? 0.0 : share;
  }
}

namespace {

/// Candidate bones are nearer than this multiple of the nearest bone's interior distance.
constexpr float farthest_share = 12.0f;
/// Weight of the penalties, in squared sizes of the shape.
constexpr double distance_weight = 2e-6;

}  // namespace

BoneChoice::BoneChoice(const RigShape& rig, Index node,
                       const Eigen::Ref<const Eigen::Matrix<float, 1, Eigen::Dynamic>>& distances, int side,
                       double share)
    : share_(share) {
  const Skeleton& skeleton = rig.skeleton;
  const auto is_other = [&](Index b) { return rig.sides[b] * side < 0; };
  std::vector<Index> all;
  for (Index b = 0; b < skeleton.count(); ++b)
    if (share > 0.0 || !is_other(b)) all.push_back(b);
  const Index most = std::min<Index>(most_candidates, static_cast<Index>(all.size()));
  std::ranges::partial_sort(all, all.begin() + most, {}, [&](Index b) { return distances[b]; });
  const float least = std::max(distances[all.front()], static_cast<float>(rig.spacing));
  for (Index k = 0; k < most; ++k)
    if (distances[all[k]] < farthest_share * least && rig.may_move(all[k], node, static_cast<double>(least)))
      bones.push_back(all[k]);
  if (bones.empty()) bones.push_back(all.front());
  for (Index k = 0; k < count(); ++k)
    if (is_other(bones[k])) others_.push_back(k);
  std::vector<double> costs;
  for (const Index b : bones) {
    const double farther = static_cast<double>(distances[b] / least) - 1.0;
    costs.push_back(distance_weight * farther * farther);
  }
  penalties = Eigen::Map<const Vector>(costs.data(), static_cast<Index>(costs.size()));
}

BonePairs BoneChoice::square(const Vec3& rest, const std::vector<Mat4>& motions, const Vec3& there,
                             double extent) const {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, most_candidates> off(3, count());
  for (Index k = 0; k < count(); ++k)
    off.col(k) = ((motions[bones[k]] * rest.homogeneous()).head<3>() - there) / extent;
  return off.transpose() * off;
}

BonePairs BoneChoice::held_back(const BonePairs& squares) const {
  BonePairs result = squares;
  for (const Index j : others_)
    for (const Index k : others_) result(j, k) /= share_;
  return result;
}

}  // namespace arapfields
