// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/node_owners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <queue>

#include "core/parallel.h"
#include "skin/bone_inside.h"

namespace arapfields {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();
/// Surfaces with fewer samples cannot enclose a bone.
constexpr Index least_samples = BoneSight::all_sides;
/// A joint is the centre of a surface with at least so many samples, if the ratio of their largest and
/// smallest distance, and that of the distance of their mean, are at most these.
constexpr Index least_around = 4;
constexpr double farthest_around = 1.5, mean_around = 0.6;
/// A ring covers all of so many sectors around a bone; the ratio of the smallest and the largest distance is
/// at least ring_share.
constexpr std::size_t ring_sides = 8;
constexpr double ring_share = 0.25;
/// A surface touches nodes that are at most so many spacings farther than the nearest one.
constexpr double touching_spacings = 0.5;

}  // namespace

NodeOwners::NodeOwners(const PiecePoints& surfaces, const std::vector<Index>& nodes, double spacing,
                       const InteriorGraph& graph)
    : surfaces_(surfaces),
      nodes_(nodes),
      spacing_(spacing),
      graph_(graph),
      slots_(surfaces.count(), -1),
      best_(nodes.size(), {infinity, -1}),
      own_(slots_.size()) {
  std::vector<Index> sizes(slots_.size(), 0);
  for (const Index piece : surfaces.pieces) ++sizes[piece];
  for (std::size_t piece = 0; piece < sizes.size(); ++piece)
    if (sizes[piece] >= least_samples) slots_[piece] = slot_count_++;
}

std::vector<Index> NodeOwners::found(Skeleton& skeleton) {
  see(skeleton);
  spread();
  take_free_surfaces(skeleton);
  fill();
  for (std::size_t i = 0; i < best_.size(); ++i)
    if (has_bone(i)) own_[piece(i)].insert(best_[i].second);
  touch(skeleton);
  spread();
  fill();
  std::vector<Index> result;
  for (const Length& each : best_) result.push_back(each.second);
  return result;
}

std::vector<Index> NodeOwners::own_bones() const {
  std::vector<Index> result;
  for (const std::set<Index>& each : own_) result.push_back(static_cast<Index>(each.size()));
  return result;
}

/// Clips the bones, and finds the initial paths: straight ones from each bone to the nodes that it sees.
void NodeOwners::see(Skeleton& skeleton) {
  straight_.resize(graph_.size(), skeleton.count());
  std::vector<std::vector<Length>> paths(skeleton.count(), best_);
  const BoneSurroundings surroundings(surfaces_, slots_, slot_count_, spacing_);
  parallel_jobs(skeleton.count(), [&](Index b) {
    const Index around = skeleton.has_open_end(b) ? surface_around(skeleton.bone(b).head) : -1;
    std::optional<BoneInside> inside;
    if (around < 0) {
      inside.emplace(skeleton, b, surroundings);
      if (!inside->parts().empty()) skeleton.set_parts(b, inside->parts());
    }
    for (Index i = 0; i < graph_.size(); ++i) {
      const Vec3 node = surfaces_.points.row(nodes_[i]);
      straight_(i, b) = static_cast<float>((skeleton.nearest(b, node) - node).norm());
      if (around < 0 ? inside->sees(node, slot(i)) : piece(i) == around) paths[b][i] = {straight_(i, b), b};
    }
  });
  pulls_.assign(skeleton.count(), false);
  for (const std::vector<Length>& each : paths)
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (each[i].second >= 0) pulls_[each[i].second] = true;
      best_[i] = std::min(best_[i], each[i]);
    }
}

/// The surface whose centre is a joint, such as an eyeball; −1: none.
Index NodeOwners::surface_around(const Vec3& joint) const {
  std::vector<double> least(slots_.size(), std::numeric_limits<double>::infinity()), most(slots_.size(), 0.0);
  std::vector<Vec3> sums(slots_.size(), Vec3::Zero());
  std::vector<Index> counts(slots_.size(), 0);
  for (Index i = 0; i < surfaces_.points.rows(); ++i) {
    const Vec3 offset = surfaces_.points.row(i).transpose() - joint;
    const Index piece = surfaces_.pieces[i];
    least[piece] = std::min(least[piece], offset.norm());
    most[piece] = std::max(most[piece], offset.norm());
    sums[piece] += offset;
    ++counts[piece];
  }
  Index result = -1;
  for (std::size_t piece = 0; piece < least.size(); ++piece)
    if (counts[piece] >= least_around && most[piece] < farthest_around * least[piece] &&
        sums[piece].norm() < mean_around * least[piece] * static_cast<double>(counts[piece]) &&
        (result < 0 || most[piece] < most[static_cast<std::size_t>(result)]))
      result = static_cast<Index>(piece);
  return result;
}

/// A bone in no surface takes the nearest surface without bones, which it may share with others. If no bone
/// is in a surface, each node belongs to the nearest bone. Any other bone pulls if it touches a surface, or
/// lies behind one, as the spine does in the opening of one half of a body.
void NodeOwners::take_free_surfaces(const Skeleton& skeleton) {
  std::vector<bool> has_surface(straight_.cols(), false);
  for (const Length& each : best_)
    if (each.second >= 0) has_surface[each.second] = true;
  const bool none = std::ranges::find(has_surface, true) == has_surface.end();
  std::vector<Length> taken(nodes_.size(), {infinity, -1});
  for (Index b = 0; b < straight_.cols(); ++b) {
    Index nearest = 0;
    const float distance = straight_.col(b).minCoeff(&nearest);
    const Vec3 node = surfaces_.points.row(nodes_[static_cast<std::size_t>(nearest)]);
    const Vec3 normal = surfaces_.normals.row(nodes_[static_cast<std::size_t>(nearest)]);
    const bool is_behind = normal.dot(skeleton.nearest(b, node) - node) < 0.0;
    if (none || is_behind || distance < static_cast<float>(spacing_)) pulls_[b] = true;
    if (has_surface[b] || has_bone(nearest)) continue;
    pulls_[b] = true;
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (none || piece(i) == piece(nearest))
        taken[i] = std::min(taken[i], Length(straight_(static_cast<Index>(i), b), b));
  }
  for (std::size_t i = 0; i < nodes_.size(); ++i) best_[i] = std::min(best_[i], taken[i]);
}

/// Extends the paths to all nodes of the same surface by Dijkstra's algorithm.
void NodeOwners::spread() {
  using Entry = std::pair<Length, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (std::size_t i = 0; i < best_.size(); ++i)
    if (has_bone(i)) queue.emplace(best_[i], i);
  while (!queue.empty()) {
    const auto [length, i] = queue.top();
    queue.pop();
    if (length > best_[i]) continue;
    for (const InteriorGraph::Edge& edge : graph_.edges(static_cast<Index>(i))) {
      const Length next(length.first + edge.length, length.second);
      if (!(next < best_[edge.to]) || piece(i) != piece(edge.to)) continue;
      best_[edge.to] = next;
      queue.emplace(next, edge.to);
    }
  }
}

/// Nodes without a path take the owner of the nearest node of the same surface that has one.
void NodeOwners::fill() {
  std::map<Index, Nodes> reached;
  for (std::size_t i = 0; i < best_.size(); ++i)
    if (has_bone(i)) reached[piece(i)].push_back(i);
  for (std::size_t i = 0; i < best_.size(); ++i) {
    if (has_bone(i) || !reached.contains(piece(i))) continue;
    const Nodes& others = reached[piece(i)];
    const auto nearest = std::ranges::min_element(others, {}, [&](std::size_t j) { return square(i, j); });
    best_[i] = best_[*nearest];
  }
}

/// Whether nodes form a ring around a bone.
bool NodeOwners::lies_about(const Nodes& nodes, const Bone& bone) const {
  const Mat3 axes = bone_axes(bone);
  const double length = (bone.tail - bone.head).norm();
  for (const double share : shares_along(length, spacing_)) {
    std::array<double, ring_sides> nearest;
    nearest.fill(std::numeric_limits<double>::infinity());
    for (const std::size_t i : nodes) {
      const Vec3 local = axes.transpose() * (surfaces_.points.row(nodes_[i]).transpose() - bone.head);
      const double radius = std::hypot(local[0], local[2]);
      if (std::abs(local[1] - share * length) > radius) continue;
      const double turns = std::atan2(local[0], local[2]) / (2.0 * std::numbers::pi) + 0.5;
      double& least = nearest[static_cast<std::size_t>(turns * ring_sides) % ring_sides];
      least = std::min(least, radius);
    }
    const auto [least, most] = std::ranges::minmax_element(nearest);
    if (*least > ring_share * *most) return true;
  }
  return false;
}

/// Nodes of a surface without bones take the owners of the nodes that they touch, preferably with similar
/// normals, and of bones adjacent to the nearest one. A ring belongs to the bones inside it.
void NodeOwners::touch(const Skeleton& skeleton) {
  std::map<Index, Nodes> without;
  for (std::size_t i = 0; i < best_.size(); ++i)
    if (!has_bone(i)) without[piece(i)].push_back(i);
  if (without.empty()) return;
  const auto [visible, all] = nodes_with_bones();
  const BoneTree tree(skeleton);
  for (const auto& [piece, own] : without) {
    std::vector<bool> about;
    for (Index b = 0; b < skeleton.count(); ++b) about.push_back(lies_about(own, skeleton.bone(b)));
    Nodes others;
    std::ranges::copy_if(all, std::back_inserter(others),
                         [&](std::size_t j) { return about[best_[j].second]; });
    join(own, others.empty() ? visible : others, tree);
  }
}

/// Nodes with owners: those outside of all other surfaces (all, if there are none), and all of them.
std::pair<NodeOwners::Nodes, NodeOwners::Nodes> NodeOwners::nodes_with_bones() const {
  std::vector<char> hidden(best_.size(), 0);
  parallel_for(0, graph_.size(), 16, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) hidden[i] = has_bone(i) && within_another(i) ? 1 : 0;
  });
  Nodes all, visible;
  for (std::size_t i = 0; i < best_.size(); ++i)
    if (has_bone(i)) (hidden[i] == 0 ? visible : all).push_back(i);
  all.insert(all.end(), visible.begin(), visible.end());
  return {visible.empty() ? all : visible, all};
}

/// Nodes of a surface without bones take the owners of the nearest of `others` where these touch it, but only
/// bones that may influence the region of the bone nearest to the whole surface.
void NodeOwners::join(const Nodes& own, const Nodes& others, const BoneTree& tree) {
  const auto turned = [&](std::size_t i, std::size_t j) {  // squared difference of normals times spacing²
    const auto& normals = surfaces_.normals;
    return spacing_ * spacing_ * (normals.row(nodes_[i]) - normals.row(nodes_[j])).squaredNorm();
  };
  std::vector<std::pair<double, std::size_t>> near;
  for (const std::size_t i : own) {
    near.emplace_back(std::numeric_limits<double>::infinity(), 0);
    for (const std::size_t j : others) near.back() = std::min(near.back(), {square(i, j) + turned(i, j), j});
  }
  const double reach = std::sqrt(std::ranges::min_element(near)->first) + touching_spacings * spacing_;
  std::map<Index, float> lengths;  // of the bones that it touches
  for (const auto& [square, j] : near)
    if (square <= reach * reach) lengths[best_[j].second] = 0.0f;
  for (auto& [b, length] : lengths)
    for (const std::size_t i : own) length += straight_(static_cast<Index>(i), b);
  const Index main =
      std::ranges::min_element(lengths, {}, [](const auto& each) { return each.second; })->first;
  for (std::size_t k = 0; k < own.size(); ++k)
    if (const Index b = best_[near[k].second].second;
        near[k].first <= reach * reach && tree.matters(b, main, 0.0))
      best_[own[k]] = {0.0f, b};
}

bool NodeOwners::within_another(std::size_t node) const {
  const BoneSight sight(surfaces_, slots_, slot_count_, surfaces_.points.row(nodes_[node]));
  for (Index other = 0; other < slot_count_; ++other)
    if (other != slot(node) && sight.sides(other) >= enough_sides) return true;
  return false;
}

}  // namespace arapfields
