// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/bvh.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/parallel.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {
namespace {

constexpr int most_bins = 16;
constexpr int few_bins = 8;  // for ranges with few primitives, where a sweep costs more than filling the bins
constexpr Index many_primitives = 128;

struct Bin {
  PrimitiveBox box;
  Index count = 0;
  void add(const Bin& other) {
    box.grow(other.box);
    count += other.count;
  }
  float cost() const { return box.half_area() * static_cast<float>((count + tree_width - 1) / tree_width); }
};

using Bins = std::array<std::array<Bin, most_bins>, 3>;

struct Plane {
  int axis = -1;
  int bin = 0;  // first bin of the right part
  float cost = 0;
};

/// Maps a primitive's doubled centre to a bin along every axis.
struct Binning {
  Eigen::Array4f origin, factor;
  int count;

  Binning(const PrimitiveBox& centres, Index primitives)
      : origin(centres.low), count(primitives < many_primitives ? few_bins : most_bins) {
    const Eigen::Array4f extent = centres.high - centres.low;
    factor.setZero();
    for (int k = 0; k < 3; ++k)
      if (extent[k] > 1e-30f) factor[k] = static_cast<float>(count) * 0.9999f / extent[k];
  }
  /// In 0..count−1, since no centre lies beyond those that the factor was made from.
  Eigen::Array4i bins(const Primitive& p) const {
    return ((p.box.low + p.box.high - origin) * factor).cast<int>();
  }
};

Plane best_plane(const Bins& bins, const Binning& binning) {
  Plane best;
  for (int axis = 0; axis < 3; ++axis) {
    if (binning.factor[axis] == 0.0f) continue;
    std::array<float, most_bins> right_cost{};
    Bin right, left;
    for (int b = binning.count - 1; b > 0; --b) {
      right.add(bins[axis][b]);
      right_cost[b] = right.count > 0 ? right.cost() : -1.0f;
    }
    for (int b = 1; b < binning.count; ++b) {
      left.add(bins[axis][b - 1]);
      if (left.count == 0 || right_cost[b] < 0.0f) continue;
      const float cost = left.cost() + right_cost[b];
      if (best.axis < 0 || cost < best.cost) best = {axis, b, cost};
    }
  }
  return best;
}

PrimitiveBox bounds(const std::vector<Primitive>& primitives, Index begin, Index end) {
  PrimitiveBox box;
  for (Index i = begin; i < end; ++i) box.grow(primitives[i].box);
  return box;
}

}  // namespace

std::pair<PrimitiveRange, PrimitiveRange> split(std::vector<Primitive>& primitives,
                                                const PrimitiveRange& range) {
  const auto first = primitives.begin() + range.begin, last = primitives.begin() + range.end;
  PrimitiveBox centres;
  for (auto p = first; p != last; ++p) {
    const Eigen::Array4f doubled = p->box.low + p->box.high;
    centres.low = centres.low.min(doubled);
    centres.high = centres.high.max(doubled);
  }
  const Binning binning(centres, range.size());
  Bins bins;
  for (auto p = first; p != last; ++p) {
    const Eigen::Array4i place = binning.bins(*p);
    for (int axis = 0; axis < 3; ++axis) {
      Bin& bin = bins[axis][place[axis]];
      bin.box.grow(p->box);
      ++bin.count;
    }
  }
  const Plane plane = best_plane(bins, binning);

  if (plane.axis >= 0 && range.level < skewed_split_levels) {
    const auto cut = std::partition(
        first, last, [&](const Primitive& p) { return binning.bins(p)[plane.axis] < plane.bin; });
    Bin left, right;
    for (int b = 0; b < binning.count; ++b) (b < plane.bin ? left : right).add(bins[plane.axis][b]);
    const Index middle = cut - primitives.begin();
    return {{range.begin, middle, range.level + 1, left.box},
            {middle, range.end, range.level + 1, right.box}};
  }
  // All centres are equal, or the tree has become lopsided: cut in the middle.
  const Index middle = range.begin + range.size() / 2;
  if (plane.axis >= 0)
    std::nth_element(first, primitives.begin() + middle, last, [&](const Primitive& a, const Primitive& b) {
      const float x = a.box.low[plane.axis] + a.box.high[plane.axis];
      const float y = b.box.low[plane.axis] + b.box.high[plane.axis];
      return x != y ? x < y : a.triangle < b.triangle;
    });
  return {{range.begin, middle, range.level + 1, bounds(primitives, range.begin, middle)},
          {middle, range.end, range.level + 1, bounds(primitives, middle, range.end)}};
}

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
