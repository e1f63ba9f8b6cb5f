// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/hierarchy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "distance/multipole.h"
#include "distance/packet.h"
#include "distance/split.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {
namespace {

constexpr Index grain = 4096;

/// Nodes in the order in which a depth-first walk enters them, and their leaves likewise.
struct Tree {
  std::vector<WideNode> nodes;
  std::vector<NodeMoments> moments;
  std::vector<TrianglePacket> packets;
};

/// What a finished child tells its parent.
struct Child {
  std::int32_t reference = 0;
  Box box;
  Multipole multipole;
};

class Builder {
 public:
  Builder(const Points& vertices, TrianglesIn triangles) : vertices_(vertices), triangles_(triangles) {
    primitives_.resize(static_cast<std::size_t>(triangles.rows()));
    parallel_for(0, triangles.rows(), grain, [&](Index begin, Index end) {
      for (Index t = begin; t < end; ++t)
        primitives_[static_cast<std::size_t>(t)] = {box(t), static_cast<std::int32_t>(t)};
    });
  }

  Tree build() {
    PrimitiveRange all{0, static_cast<Index>(primitives_.size()), 0, {}};
    for (const Primitive& p : primitives_) all.box.grow(p.box);
    // Two levels are split first, so that the (up to 64) subtrees below can be built side by side.
    const std::vector<PrimitiveRange> top = wide_split(all);
    std::vector<std::vector<PrimitiveRange>> second(top.size());
    parallel_jobs(static_cast<Index>(top.size()), [&](Index i) {
      const PrimitiveRange& range = top[static_cast<std::size_t>(i)];
      if (range.size() > tree_width) second[static_cast<std::size_t>(i)] = wide_split(range);
    });
    std::vector<std::pair<Index, Index>> jobs;
    for (std::size_t i = 0; i < top.size(); ++i)
      for (std::size_t j = 0; j < second[i].size(); ++j)
        jobs.emplace_back(static_cast<Index>(i), static_cast<Index>(j));
    std::vector<std::pair<Tree, Child>> subtrees(jobs.size());
    parallel_jobs(static_cast<Index>(jobs.size()), [&](Index job) {
      auto& [tree, child] = subtrees[static_cast<std::size_t>(job)];
      const auto [i, j] = jobs[static_cast<std::size_t>(job)];
      child = build_child(second[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)], tree);
    });

    Tree tree;
    std::size_t nodes = 1 + top.size(), packets = top.size();
    for (const auto& [part, child] : subtrees) {
      nodes += part.nodes.size();
      packets += part.packets.size();
    }
    tree.nodes.reserve(nodes);
    tree.moments.reserve(nodes);
    tree.packets.reserve(packets);
    auto next = subtrees.begin();
    const auto appended = [&](std::size_t) {
      const Child child = append(next->first, next->second, tree);
      ++next;
      return child;
    };
    add_node(tree, top.size(), all.box, [&](std::size_t i) {
      if (second[i].empty()) return build_child(top[i], tree);
      return add_node(tree, second[i].size(), top[i].box, appended);
    });
    return tree;
  }

 private:
  Vec3 corner(Index t, int k) const { return vertices_.row(triangles_(t, k)).transpose(); }

  Box box(Index t) const {
    const Vec3 a = corner(t, 0), b = corner(t, 1), c = corner(t, 2);
    const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    Box result;
    constexpr float infinity = std::numeric_limits<float>::infinity();
    for (int k = 0; k < 3; ++k) {
      result.low[k] = std::nextafter(static_cast<float>(low[k]), -infinity);
      result.high[k] = std::nextafter(static_cast<float>(high[k]), infinity);
    }
    return result;
  }

  /// Splits a range into up to eight, always the part whose area promises most.
  std::vector<PrimitiveRange> wide_split(const PrimitiveRange& range) {
    std::vector<PrimitiveRange> parts = {range};
    while (parts.size() < tree_width) {
      PrimitiveRange* widest = nullptr;
      for (PrimitiveRange& part : parts)
        if (part.size() > tree_width && (widest == nullptr || part.box.half_area() > widest->box.half_area()))
          widest = &part;
      if (widest == nullptr) break;
      const auto [left, right] = split(primitives_, *widest);
      *widest = left;
      parts.push_back(right);
    }
    return parts;
  }

  Child build_child(const PrimitiveRange& range, Tree& tree) {
    if (range.size() <= tree_width) return build_leaf(range, tree);
    const std::vector<PrimitiveRange> parts = wide_split(range);
    return add_node(tree, parts.size(), range.box,
                    [&](std::size_t i) { return build_child(parts[i], tree); });
  }

  Child build_leaf(const PrimitiveRange& range, Tree& tree) {
    std::array<Vec3, 3 * tree_width> corners;
    std::array<std::int32_t, tree_width> numbers{};
    const int count = static_cast<int>(range.size());
    // In the order of their numbers, so that the first of several equally near triangles is the lowest.
    std::sort(primitives_.begin() + range.begin, primitives_.begin() + range.end,
              [](const Primitive& a, const Primitive& b) { return a.triangle < b.triangle; });
    for (int i = 0; i < count; ++i)
      numbers[static_cast<std::size_t>(i)] = primitives_[static_cast<std::size_t>(range.begin + i)].triangle;
    for (int i = 0; i < count; ++i)
      for (int k = 0; k < 3; ++k)
        corners[static_cast<std::size_t>(3 * i + k)] = corner(numbers[static_cast<std::size_t>(i)], k);
    tree.packets.emplace_back();
    fill(tree.packets.back(), corners.data(), numbers.data(), count);
    return {~static_cast<std::int32_t>(tree.packets.size() - 1), range.box,
            multipole_of(corners.data(), count)};
  }

  /// Enters a node and makes its children.
  template <class MakeChild>
  static Child add_node(Tree& tree, std::size_t count, const Box& box, const MakeChild& make_child) {
    const std::size_t node = tree.nodes.size();
    tree.nodes.emplace_back();
    tree.moments.emplace_back();
    std::array<Multipole, tree_width> multipoles;
    for (std::size_t i = 0; i < tree_width; ++i) {
      const Child child = i < count ? make_child(i) : Child{};
      WideNode& wide = tree.nodes[node];
      for (int k = 0; k < 3; ++k) {
        wide.low[k][i] = i < count ? child.box.low[k] : 3e38f;
        wide.high[k][i] = i < count ? child.box.high[k] : 3e38f;
      }
      wide.child[i] = child.reference;
      multipoles[i] = child.multipole;
      if (i < count)
        store(child.multipole, tree.moments[node], static_cast<int>(i));
      else
        store_nothing(tree.moments[node], static_cast<int>(i));
    }
    tree.nodes[node].count = static_cast<std::int32_t>(count);
    return {static_cast<std::int32_t>(node), box, multipole_of(multipoles.data(), static_cast<int>(count))};
  }

  /// Moves a subtree behind what is there.
  static Child append(const Tree& part, Child child, Tree& tree) {
    const auto node = static_cast<std::int32_t>(tree.nodes.size());
    const auto packet = static_cast<std::int32_t>(tree.packets.size());
    const auto moved = [&](std::int32_t reference) {
      return reference >= 0 ? reference + node : reference - packet;
    };
    tree.packets.insert(tree.packets.end(), part.packets.begin(), part.packets.end());
    tree.moments.insert(tree.moments.end(), part.moments.begin(), part.moments.end());
    for (WideNode wide : part.nodes) {
      for (int i = 0; i < wide.count; ++i) wide.child[i] = moved(wide.child[i]);
      tree.nodes.push_back(wide);
    }
    child.reference = moved(child.reference);
    return child;
  }

  const Points& vertices_;
  TrianglesIn triangles_;
  std::vector<Primitive> primitives_;
};

}  // namespace

Hierarchy::Hierarchy(PointsIn vertices, TrianglesIn triangles) {
  const Points used = used_vertices(vertices, triangles);
  const Vec3 low = used.colwise().minCoeff(), high = used.colwise().maxCoeff();
  center_ = 0.5 * low + 0.5 * high;
  const double half = std::max((high - center_).maxCoeff(), std::numeric_limits<double>::min());
  factor_ = std::ldexp(1.0, std::clamp(-std::ilogb(half) - 1, -1000, 1000));
  const Points normalized_vertices = (vertices.rowwise() - center_.transpose()) * factor_;
  Tree tree = Builder(normalized_vertices, triangles).build();
  nodes_ = std::move(tree.nodes);
  moments_ = std::move(tree.moments);
  packets_ = std::move(tree.packets);
}

HierarchyView Hierarchy::view() const {
  return {nodes_.data(), moments_.data(), packets_.data(), static_cast<std::int32_t>(packets_.size())};
}

}  // namespace arapfields
