// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/morton.h"

#include <algorithm>
#include <array>

#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr int digit_bits = 10;
constexpr std::uint32_t digit_mask = (1u << digit_bits) - 1;
constexpr Index codes_a_task = 8192;

struct Keyed {
  std::uint32_t key;
  std::uint32_t index;
};

/// Puts two zero bits after each of the ten low bits.
std::uint32_t spread(std::uint32_t x) {
  x = (x | (x << 16)) & 0x030000ffu;
  x = (x | (x << 8)) & 0x0300f00fu;
  x = (x | (x << 4)) & 0x030c30c3u;
  return (x | (x << 2)) & 0x09249249u;
}

/// One pass of a stable radix sort.
void sort_by_digit(const std::vector<Keyed>& from, std::vector<Keyed>& to, int shift) {
  std::array<std::uint32_t, digit_mask + 1> position{};
  for (const Keyed& k : from) ++position[(k.key >> shift) & digit_mask];
  std::uint32_t sum = 0;
  for (std::uint32_t& p : position) {
    const std::uint32_t count = p;
    p = sum;
    sum += count;
  }
  for (const Keyed& k : from) to[position[(k.key >> shift) & digit_mask]++] = k;
}

}  // namespace

std::vector<std::uint32_t> morton_order(PointsIn points) {
  const auto count = static_cast<std::size_t>(points.rows());
  if (count == 0) return {};
  const Vec3 low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  const double side = std::max(0.5 * (0.5 * high - 0.5 * low).maxCoeff(), 1e-300);
  const double factor = 0.25 * 1023.999 / side;
  std::vector<Keyed> keyed(count), other(count);
  parallel_for(0, points.rows(), codes_a_task, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      std::uint32_t key = 0;
      for (int k = 0; k < 3; ++k)
        key |= spread(static_cast<std::uint32_t>((points(i, k) - low[k]) * factor)) << k;
      keyed[i] = {key, static_cast<std::uint32_t>(i)};
    }
  });
  sort_by_digit(keyed, other, 0);
  sort_by_digit(other, keyed, digit_bits);
  sort_by_digit(keyed, other, 2 * digit_bits);
  std::vector<std::uint32_t> order(count);
  for (std::size_t i = 0; i < count; ++i) order[i] = other[i].index;
  return order;
}

}  // namespace arapfields
