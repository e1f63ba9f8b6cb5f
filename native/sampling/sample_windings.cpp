// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/sample_windings.h"

#include <numbers>

#include "core/point_grid.h"

namespace arapfields {

SampleWindings::SampleWindings(PointsIn places, PointsIn normals, double edge)
    : blur_(static_cast<float>(0.25 * edge * edge)) {
  const PointGrid grid(places, edge);
  places_.resize(grid.size(), 3);
  normals_.resize(grid.size(), 3);
  for (Index cell = 0; cell < grid.size(); ++cell) {
    Vec3 middle = Vec3::Zero(), area = Vec3::Zero();
    for (const Index i : grid.rows(cell)) {
      middle += places.row(i).transpose();
      area += normals.row(i).transpose();
    }
    middle /= static_cast<double>(grid.rows(cell).size());
    places_.row(cell) = middle.transpose().cast<float>();
    normals_.row(cell) = (area / (4.0 * std::numbers::pi)).transpose().cast<float>();
  }
}

double SampleWindings::at(const Vec3& place) const {
  const Eigen::Array3f from = place.cast<float>();
  const auto x = places_.col(0) - from[0], y = places_.col(1) - from[1], z = places_.col(2) - from[2];
  const auto square = x.square() + y.square() + z.square() + blur_;
  const auto facing = x * normals_.col(0) + y * normals_.col(1) + z * normals_.col(2);
  return (facing / (square * square.sqrt())).sum();
}

}  // namespace arapfields
