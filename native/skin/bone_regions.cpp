// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_regions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/parallel.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "skin/node_owners.h"

namespace arapfields {

Index PiecePoints::count() const { return pieces.empty() ? 0 : 1 + *std::ranges::max_element(pieces); }

std::vector<Index> nearest_on_own(const PiecePoints& points, const PiecePoints& others, double turn,
                                  Index enough) {
  std::vector<Index> result =
      OrientedPoints(others.points, others.normals).nearest(points.points, points.normals, turn);
  std::map<Index, std::vector<Index>> own, missed;
  for (std::size_t j = 0; j < others.pieces.size(); ++j)
    own[others.pieces[j]].push_back(static_cast<Index>(j));
  for (std::size_t i = 0; i < result.size(); ++i)
    if (points.pieces[i] != others.pieces[result[i]])
      missed[points.pieces[i]].push_back(static_cast<Index>(i));
  for (const auto& [piece, rows] : missed) {
    const std::vector<Index>& candidates = own[piece];
    if (static_cast<Index>(candidates.size()) < std::max<Index>(enough, 1)) continue;
    const std::vector<Index> near =
        OrientedPoints(rows_of(others.points, candidates), rows_of(others.normals, candidates))
            .nearest(rows_of(points.points, rows), rows_of(points.normals, rows), turn);
    for (std::size_t k = 0; k < rows.size(); ++k) result[rows[k]] = candidates[near[k]];
  }
  return result;
}

namespace {

/// Distance to a bone that does not pull, in largest distances.
constexpr float unreachable = 1e3f;
constexpr float unreached = std::numeric_limits<float>::infinity();
/// A bone may influence another's region within so many steps, or if the bones between them have at most this
/// length, relative to the distance.
constexpr int most_steps = 2;
constexpr double most_between = 0.5;

}  // namespace

BoneRegions::BoneRegions(Skeleton& skeleton, const PiecePoints& surfaces, const std::vector<Index>& nodes,
                         double spacing, const InteriorGraph& graph) {
  NodeOwners owners(surfaces, nodes, spacing, graph);
  owner = owners.found(skeleton);
  own_bones = owners.own_bones();
  pulls = owners.pulls();
  straight = owners.straight();
}

RowMatrix<float> BoneRegions::distances(const InteriorGraph& graph) const {
  RowMatrix<float> result(straight.rows(), straight.cols());
  parallel_jobs(straight.cols(), [&](Index b) {
    if (!pulls[b]) {
      result.col(b).setConstant(unreachable * straight.maxCoeff());
      return;
    }
    std::vector<float> start(owner.size(), unreached);
    for (Index i = 0; i < graph.size(); ++i)
      if (owner[i] == b) start[i] = straight(i, b);
    if (std::ranges::find(owner, b) == owner.end()) {  // a bone that owns no node starts at the nearest
      Index nearest = 0;
      straight.col(b).minCoeff(&nearest);
      start[nearest] = straight(nearest, b);
    }
    const std::vector<float> lengths = graph.distances_from(std::move(start));
    for (Index i = 0; i < graph.size(); ++i) result(i, b) = lengths[i];
  });
  return result;
}

BoneTree::BoneTree(const Skeleton& skeleton)
    : steps_(Eigen::MatrixXi::Zero(skeleton.count(), skeleton.count())),
      between_(Eigen::MatrixXd::Zero(skeleton.count(), skeleton.count())) {
  const Index n = skeleton.count();
  std::vector<std::vector<Index>> joined(n);
  for (Index b = 0; b < n; ++b)
    if (const Index parent = skeleton.bone(b).parent; parent >= 0) {
      joined[b].push_back(parent);
      joined[parent].push_back(b);
    }
  for (Index from = 0; from < n; ++from) {
    std::vector<std::pair<Index, Index>> open{{from, -1}};  // bones and their predecessors
    for (std::size_t k = 0; k < open.size(); ++k) {
      const auto [b, before] = open[k];
      double length = 0.0;
      for (const BonePart& part : skeleton.parts(b))
        length = std::max(length, (part.end - part.start).norm());
      for (const Index next : joined[b]) {
        if (next == before) continue;
        steps_(from, next) = steps_(from, b) + 1;
        between_(from, next) = between_(from, b) + (b == from ? 0.0 : length);
        open.emplace_back(next, b);
      }
    }
  }
}

bool BoneTree::matters(Index bone, Index owner, double distance) const {
  return steps_(owner, bone) <= most_steps || between_(owner, bone) <= most_between * distance;
}

namespace {

/// A point is occluded if it is farther than this multiple of the depth in its direction.
constexpr double hidden = 1.2;

/// The cell of a cube map, with count × count cells a face, in a direction.
std::size_t cell_of(const Vec3& direction, int count) {
  int axis = 0;
  const double most = direction.cwiseAbs().maxCoeff(&axis);
  const auto at = [&](double x) {
    return std::clamp(static_cast<int>((0.5 + 0.5 * x / most) * count), 0, count - 1);
  };
  const int face = 2 * axis + (direction[axis] < 0.0 ? 1 : 0);
  return static_cast<std::size_t>((face * count + at(direction[(axis + 1) % 3])) * count +
                                  at(direction[(axis + 2) % 3]));
}

}  // namespace

BoneSight::BoneSight(const PiecePoints& surfaces, const std::vector<Index>& slots, Index count,
                     const Vec3& place)
    : place_(place), sides_(count), depths_(count) {
  for (auto& each : depths_) each.fill(std::numeric_limits<float>::infinity());
  for (Index i = 0; i < surfaces.points.rows(); ++i) {
    const Vec3 direction = surfaces.points.row(i).transpose() - place;
    const double distance = direction.norm();
    const Index slot = slots[surfaces.pieces[i]];
    if (slot < 0 || !(distance > 0.0)) continue;
    sides_[slot][cell_of(direction, wide)] = true;
    float& depth = depths_[slot][cell_of(direction, fine)];
    depth = std::min(depth, static_cast<float>(distance));
  }
}

bool BoneSight::sees(const Vec3& point, Index slot, double tolerance) const {
  const Vec3 direction = point - place_;
  const double distance = direction.norm();
  if (!(distance > 0.0)) return true;
  const auto depth = static_cast<double>(depths_[static_cast<std::size_t>(slot)][cell_of(direction, fine)]);
  return distance <= hidden * depth + tolerance;
}

}  // namespace arapfields
