// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/nearest_sample.h"

#include "core/frame.h"

namespace arapfields {

SignedDistance nearest_samples(PointsIn samples, const Progress& progress) {
  Triangles corners(samples.rows(), 3);
  for (Index i = 0; i < samples.rows(); ++i) corners.row(i).setConstant(static_cast<std::int32_t>(i));
  return SignedDistance(samples, corners, progress);
}

Vector nearest_distances(PointsIn samples, PointsIn points, const Progress& progress) {
  Vector result(points.rows());
  if (points.rows() > 0) nearest_samples(samples, progress).unsigned_distance(points, result, progress);
  return result;
}

double body_size(PointsIn samples) {
  constexpr double size_of_gyration = 2.5;
  const bool extended = (samples.rowwise() - samples.row(0)).cwiseAbs().maxCoeff() > 0.0;
  return extended ? size_of_gyration * Frame::balanced(samples, Vector::Ones(samples.rows()), {}, 1.0).scale
                  : 1.0;
}

}  // namespace arapfields
