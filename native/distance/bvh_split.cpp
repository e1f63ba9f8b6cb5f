// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/bvh_split.h"

#include <algorithm>
#include <array>

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

}  // namespace arapfields
