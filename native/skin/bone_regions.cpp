// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_regions.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "skin/node_owners.h"

namespace arapfields {
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

}  // namespace arapfields
