// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/held_parts.h"

#include <algorithm>

#include "sampling/nearest_sample.h"

namespace arapfields {

Vector held_shares(PointsIn points, PointsIn sites, const std::vector<Index>& parts, PointsIn held) {
  if (parts.empty()) return {};
  const Index count = *std::max_element(parts.begin(), parts.end()) + 1;
  if (count == 1) return {};
  const SignedDistance nearest = nearest_samples(sites);
  Vector is_held = Vector::Zero(count);
  for (const std::int32_t site : nearest.closest(held).triangles)
    is_held[parts[static_cast<std::size_t>(site)]] = 1.0;
  Vector shares(points.rows());
  const std::vector<std::int32_t> near = nearest.closest(points).triangles;
  for (Index i = 0; i < points.rows(); ++i)
    shares[i] = is_held[parts[static_cast<std::size_t>(near[static_cast<std::size_t>(i)])]];
  return shares;
}

}  // namespace arapfields
