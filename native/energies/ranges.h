// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "core/parallel.h"

namespace arapfields {

/// Points a range of work holds; a multiple of every pack width, and fixed, so that sums over ranges do not
/// depend on the number of threads.
constexpr Index range_size = 256;

/// body(begin, end) for the ranges of {0, …, count−1}, in parallel.
template <class Body>
void for_ranges(Index count, Body&& body) {
  const Index ranges = (count + range_size - 1) / range_size;
  parallel_for(0, ranges, 1, [&](Index first, Index last) {
    for (Index r = first; r < last; ++r) body(r * range_size, std::min(count, (r + 1) * range_size));
  });
}

/// Totals of what body(begin, end, sums) adds to its zeroed sums for each range, added in order.
template <int count_of_sums, class Body>
std::array<double, count_of_sums> sum_over_ranges(Index count, Body&& body) {
  std::vector<std::array<double, count_of_sums>> parts(
      static_cast<std::size_t>((count + range_size - 1) / range_size), std::array<double, count_of_sums>{});
  for_ranges(count, [&](Index begin, Index end) { body(begin, end, parts[begin / range_size].data()); });
  std::array<double, count_of_sums> total{};
  for (const auto& part : parts)
    for (int i = 0; i < count_of_sums; ++i) total[i] += part[i];
  return total;
}

}  // namespace arapfields
