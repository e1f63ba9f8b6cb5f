// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/held_parts.h"

#include <algorithm>

#include "energies/handles.h"
#include "sampling/nearest_sample.h"

namespace arapfields {

Vector locality_shares(PointsIn points, const std::vector<Index>& rows, const BoundHandles& handles,
                       PointsIn held, const SurfaceParts& surface) {
  Vector shares = Vector::Ones(points.rows());
  std::vector<Index> members = handles.members();
  std::sort(members.begin(), members.end());
  for (Index i = 0; i < shares.size(); ++i)
    if (std::binary_search(members.begin(), members.end(), rows[static_cast<std::size_t>(i)]))
      shares[i] = 0.0;
  const auto& parts = surface.parts;
  if (parts.empty() || *std::max_element(parts.begin(), parts.end()) == 0) return shares;
  const SignedDistance nearest = nearest_samples(surface.sites);
  std::vector<bool> is_held(parts.size());  // by part
  const auto part = [&](std::int32_t site) {
    return static_cast<std::size_t>(parts[static_cast<std::size_t>(site)]);
  };
  for (const std::int32_t site : nearest.closest(held).triangles) is_held[part(site)] = true;
  const std::vector<std::int32_t> near = nearest.closest(points).triangles;
  for (Index i = 0; i < shares.size(); ++i)
    if (!is_held[part(near[static_cast<std::size_t>(i)])]) shares[i] = 0.0;
  return shares;
}

}  // namespace arapfields
