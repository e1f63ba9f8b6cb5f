// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/point_grid.h"

#include <algorithm>

namespace arapfields {

PointGrid::PointGrid(PointsIn points, double reach) : start_(2, 0) {
  if (points.rows() == 0) return;
  const Vec3 low = points.colwise().minCoeff().transpose();
  const Vec3 extent = points.colwise().maxCoeff().transpose() - low;
  const double edge = std::max(reach, extent.maxCoeff() / (most_cells_a_side - 1));
  counts_ = (extent / edge).array().floor().cast<int>() + 1;
  std::vector<std::size_t> places(static_cast<std::size_t>(points.rows()));
  start_.assign(static_cast<std::size_t>(counts_.prod()) + 1, 0);
  for (Index i = 0; i < points.rows(); ++i) {
    const Eigen::Array3i at =
        ((points.row(i).transpose() - low) / edge).array().floor().cast<int>().min(counts_ - 1);
    const auto place = static_cast<std::size_t>((at[0] * counts_[1] + at[1]) * counts_[2] + at[2]);
    places[static_cast<std::size_t>(i)] = place;
    ++start_[place + 1];
  }
  numbers_.assign(start_.size() - 1, -1);
  for (std::size_t c = 0; c + 1 < start_.size(); ++c) {
    if (start_[c + 1] > 0) numbers_[c] = std::ssize(cells_), cells_.push_back(static_cast<Index>(c));
    start_[c + 1] += start_[c];
  }
  std::vector<Index> next(start_.begin(), start_.end() - 1);
  rows_.resize(places.size());
  for (std::size_t i = 0; i < places.size(); ++i)
    rows_[static_cast<std::size_t>(next[places[i]]++)] = static_cast<Index>(i);
}

}  // namespace arapfields
