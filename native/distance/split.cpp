// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/split.h"

#include <algorithm>
#include <array>

#include "distance/hierarchy_layout.h"

namespace arapfields {
namespace {

constexpr int bin_count = 16;

struct Bin {
  Box box;
  Index count = 0;
};

struct Plane {
  int axis = -1;
  int bin = 0;  // first bin of the right part
  float cost = 0;
};

/// Maps a primitive's doubled centre to a bin along every axis.
struct Binning {
  Eigen::Array3f origin, factor;

  explicit Binning(const Box& centres) : origin(centres.low) {
    const Eigen::Array3f extent = centres.high - centres.low;
    for (int k = 0; k < 3; ++k) factor[k] = extent[k] > 1e-30f ? bin_count * 0.9999f / extent[k] : 0.0f;
  }
  int bin(const Primitive& p, int axis) const {
    const float x = (p.box.low[axis] + p.box.high[axis] - origin[axis]) * factor[axis];
    return std::clamp(static_cast<int>(x), 0, bin_count - 1);
  }
};

float packets(Index count) { return static_cast<float>((count + tree_width - 1) / tree_width); }

Plane best_plane(const std::array<std::array<Bin, bin_count>, 3>& bins, const Binning& binning) {
  Plane best;
  for (int axis = 0; axis < 3; ++axis) {
    if (binning.factor[axis] == 0.0f) continue;
    std::array<float, bin_count> right_cost{};
    Bin right;
    for (int b = bin_count - 1; b > 0; --b) {
      right.box.grow(bins[axis][b].box);
      right.count += bins[axis][b].count;
      right_cost[b] = right.count > 0 ? right.box.half_area() * packets(right.count) : -1.0f;
    }
    Bin left;
    for (int b = 1; b < bin_count; ++b) {
      left.box.grow(bins[axis][b - 1].box);
      left.count += bins[axis][b - 1].count;
      if (left.count == 0 || right_cost[b] < 0.0f) continue;
      const float cost = left.box.half_area() * packets(left.count) + right_cost[b];
      if (best.axis < 0 || cost < best.cost) best = {axis, b, cost};
    }
  }
  return best;
}

Box bounds(const std::vector<Primitive>& primitives, Index begin, Index end) {
  Box box;
  for (Index i = begin; i < end; ++i) box.grow(primitives[static_cast<std::size_t>(i)].box);
  return box;
}

}  // namespace

std::pair<PrimitiveRange, PrimitiveRange> split(std::vector<Primitive>& primitives,
                                                const PrimitiveRange& range) {
  const auto first = primitives.begin() + range.begin, last = primitives.begin() + range.end;
  Box centres;
  for (auto p = first; p != last; ++p) {
    const Eigen::Array3f doubled = p->box.low + p->box.high;
    centres.grow({doubled, doubled});
  }
  const Binning binning(centres);
  std::array<std::array<Bin, bin_count>, 3> bins{};
  for (auto p = first; p != last; ++p)
    for (int axis = 0; axis < 3; ++axis) {
      Bin& bin = bins[axis][binning.bin(*p, axis)];
      bin.box.grow(p->box);
      ++bin.count;
    }
  const Plane plane = best_plane(bins, binning);

  Index middle = range.begin + range.size() / 2;
  if (plane.axis >= 0 && range.level < skewed_split_levels) {
    const auto cut = std::partition(
        first, last, [&](const Primitive& p) { return binning.bin(p, plane.axis) < plane.bin; });
    middle = cut - primitives.begin();
  } else if (plane.axis >= 0) {
    std::nth_element(first, primitives.begin() + middle, last, [&](const Primitive& a, const Primitive& b) {
      const float x = a.box.low[plane.axis] + a.box.high[plane.axis];
      const float y = b.box.low[plane.axis] + b.box.high[plane.axis];
      return x != y ? x < y : a.triangle < b.triangle;
    });
  }
  return {{range.begin, middle, range.level + 1, bounds(primitives, range.begin, middle)},
          {middle, range.end, range.level + 1, bounds(primitives, middle, range.end)}};
}

}  // namespace arapfields
