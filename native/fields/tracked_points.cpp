// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/tracked_points.h"

#include <utility>

#include "core/errors.h"
#include "distance/morton.h"

namespace arapfields {

TrackedPoints::TrackedPoints(const RadialBasis& basis, const Frame& frame, PointsIn mesh_points,
                             std::shared_ptr<const Triangles> triangles)
    : frame_(frame), rest_(mesh_points), triangles_(std::move(triangles)) {
  require(mesh_points.allFinite(), "points", "some are NaN or infinite", "all must be finite");
  if (triangles_) validate(mesh_points, *triangles_);
  if (mesh_points.rows() == 0) return;
  order_ = morton_order(mesh_points);
  Points sorted(mesh_points.rows(), 3);
  for (Index i = 0; i < sorted.rows(); ++i) sorted.row(i) = mesh_points.row(order_[i]);
  std::vector<SurfaceSide> sides;
  if (triangles_ && basis.embedding && basis.embedding->has_sides()) {
    const std::vector<SurfaceSide> given = basis.embedding->sides_of({mesh_points, *triangles_}, frame);
    for (const std::uint32_t i : order_) sides.push_back(given[i]);
  }
  evaluator_ = RadialEvaluator<float>(basis, frame.to_cube(sorted), JetOrder::value, nullptr,
                                      sides.empty() ? nullptr : &sides);
}

void TrackedPoints::set_influence(const std::shared_ptr<const Influence>& influence) {
  if (influence == influence_) return;
  influence_ = influence;
  shares_ = influence != nullptr ? influence->at(frame_.to_cube(rest_)) : Vector();
}

PointsF TrackedPoints::moved(const RowMatrix<double>& coefficients) const {
  PointsF result(size(), 3);
  if (size() == 0) return result;
  PointsF sorted(size(), 3);
  evaluator_.evaluate(coefficients, {sorted.data(), size(), JetOrder::value});
  const Eigen::RowVector3d center = frame_.center.transpose();
  for (Index i = 0; i < size(); ++i)
    result.row(order_[i]) = (frame_.scale * sorted.row(i).cast<double>() + center).cast<float>();
  for (Index i = 0; i < shares_.size(); ++i)
    if (shares_[i] < 1.0)
      result.row(i) =
          (rest_.row(i) + shares_[i] * (result.row(i).cast<double>() - rest_.row(i))).cast<float>();
  return result;
}

}  // namespace arapfields
