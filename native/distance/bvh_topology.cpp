// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/bvh_topology.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"
#include "distance/bvh_split.h"

namespace arapfields {
namespace {

constexpr Index grain = 4096;

/// A conservative box of the triangle: single precision, enlarged by more than its rounding.
PrimitiveBox outer_box(const Points& vertices, TrianglesIn triangles, Index t) {
  const Vec3 a = vertices.row(triangles(t, 0)), b = vertices.row(triangles(t, 1));
  const Vec3 c = vertices.row(triangles(t, 2));
  PrimitiveBox box;
  box.low.head<3>() = a.cwiseMin(b).cwiseMin(c).cast<float>();
  box.high.head<3>() = a.cwiseMax(b).cwiseMax(c).cast<float>();
  box.low[3] = box.high[3] = 0.0f;
  box.low -= box.low.abs() * 1.2e-7f + 1e-38f;
  box.high += box.high.abs() * 1.2e-7f + 1e-38f;
  return box;
}

class Builder {
 public:
  Builder(const Points& vertices, TrianglesIn triangles, const Progress& progress)
      : primitives_(triangles.rows()), progress_(progress) {
    parallel_for(0, triangles.rows(), grain, [&](Index begin, Index end) {
      progress.check();
      for (Index t = begin; t < end; ++t)
        primitives_[t] = {outer_box(vertices, triangles, t), static_cast<std::int32_t>(t)};
    });
  }

  /// Two levels are split first; the (up to 64) subtrees below are then built in parallel.
  Topology build() {
    PrimitiveRange all{0, static_cast<Index>(primitives_.size()), 0, {}};
    for (const Primitive& p : primitives_) all.box.grow(p.box);
    const std::vector<PrimitiveRange> top = wide_split(all);
    std::vector<std::vector<PrimitiveRange>> second(top.size());
    parallel_jobs(static_cast<Index>(top.size()), [&](Index i) {
      const PrimitiveRange& range = top[i];
      if (range.size() > tree_width) second[i] = wide_split(range);
    });
    std::vector<PrimitiveRange> jobs;
    for (const auto& ranges : second) jobs.insert(jobs.end(), ranges.begin(), ranges.end());
    std::vector<std::pair<Topology, std::int32_t>> parts(jobs.size());
    parallel_jobs(static_cast<Index>(jobs.size()), [&](Index job) {
      auto& [part, root] = parts[job];
      root = add_child(jobs[job], part);
    });

    Topology tree;
    auto next = parts.begin();
    const auto next_part = [&](const PrimitiveRange&) {
      const std::int32_t root = append(next->first, next->second, tree);
      ++next;
      if (root >= 0) tree.subtrees.push_back(root);
      return root;
    };
    add_node(top, tree, [&](const PrimitiveRange& range) {
      const auto& ranges = second[&range - top.data()];
      return ranges.empty() ? add_child(range, tree) : add_node(ranges, tree, next_part);
    });
    tree.triangles.resize(primitives_.size());
    std::transform(primitives_.begin(), primitives_.end(), tree.triangles.begin(),
                   [](const Primitive& p) { return p.triangle; });
    return tree;
  }

 private:
  /// Splits a range into up to eight, always the part with the largest area.
  std::vector<PrimitiveRange> wide_split(const PrimitiveRange& range) {
    std::vector<PrimitiveRange> parts = {range};
    while (parts.size() < tree_width) {
      PrimitiveRange* widest = nullptr;
      for (PrimitiveRange& part : parts)
        if (part.size() > tree_width && (!widest || part.box.half_area() > widest->box.half_area()))
          widest = &part;
      if (widest == nullptr) break;
      progress_.check();
      const auto [left, right] = split(primitives_, *widest);
      *widest = left;
      parts.push_back(right);
    }
    return parts;
  }

  std::int32_t add_child(const PrimitiveRange& range, Topology& tree) {
    if (range.size() > tree_width)
      return add_node(wide_split(range), tree, [&](const PrimitiveRange& r) { return add_child(r, tree); });
    // In ascending order, so that of several equally near triangles the one of lowest index is found.
    std::sort(primitives_.begin() + range.begin, primitives_.begin() + range.end,
              [](const Primitive& a, const Primitive& b) { return a.triangle < b.triangle; });
    tree.leaves.push_back({range.begin, static_cast<int>(range.size())});
    return ~static_cast<std::int32_t>(tree.leaves.size() - 1);
  }

  template <class AddChild>
  static std::int32_t add_node(const std::vector<PrimitiveRange>& children, Topology& tree,
                               const AddChild& add_child) {
    const std::size_t node = tree.nodes.size();
    tree.nodes.emplace_back();
    tree.nodes[node].count = static_cast<std::int32_t>(children.size());
    for (std::size_t i = 0; i < children.size(); ++i) {
      const std::int32_t child = add_child(children[i]);
      WideNode& wide = tree.nodes[node];
      wide.child[i] = child;
      for (int k = 0; k < 3; ++k) {
        wide.low[k][i] = children[i].box.low[k];
        wide.high[k][i] = children[i].box.high[k];
      }
    }
    return static_cast<std::int32_t>(node);
  }

  /// Appends a subtree to a tree; returns its new root.
  static std::int32_t append(const Topology& part, std::int32_t root, Topology& tree) {
    const auto node = static_cast<std::int32_t>(tree.nodes.size());
    const auto leaf = static_cast<std::int32_t>(tree.leaves.size());
    const auto moved = [&](std::int32_t child) { return child >= 0 ? child + node : child - leaf; };
    tree.leaves.insert(tree.leaves.end(), part.leaves.begin(), part.leaves.end());
    tree.nodes.insert(tree.nodes.end(), part.nodes.begin(), part.nodes.end());
    for (auto wide = tree.nodes.begin() + node; wide != tree.nodes.end(); ++wide)
      for (int i = 0; i < wide->count; ++i) wide->child[i] = moved(wide->child[i]);
    return moved(root);
  }

  std::vector<Primitive> primitives_;
  const Progress& progress_;
};

}  // namespace

Topology build_topology(const Points& vertices, TrianglesIn triangles, const Progress& progress) {
  return Builder(vertices, triangles, progress).build();
}

}  // namespace arapfields
