// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/surface_stiffness.h"

#include <algorithm>

#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// √λ over the local thickness, chosen such that λ is the paper's 0.01 at the bunny's median thickness.
constexpr double bending_length = 0.345;
/// Weight of a sample in a handle that may scale.
constexpr double yielding = 0.01;
/// The paper's λ, for a stiffness that is the same everywhere.
constexpr double uniform_bending = 0.01;

}  // namespace

SurfaceStiffness::SurfaceStiffness(std::shared_ptr<const LocalThickness> thickness,
                                   const SurfaceOptions& options)
    : bending_(options.bending * (options.bending_unit == BendingUnit::cube
                                      ? uniform_bending
                                      : bending_length * bending_length)) {
  if (bending_ > 0.0 && options.bending_unit == BendingUnit::thickness) thickness_ = std::move(thickness);
}

SurfaceStiffness::SurfaceStiffness(const SurfaceSamples& samples, const SurfaceOptions& options)
    : SurfaceStiffness(nullptr, options) {
  if (bending_ > 0.0 && options.bending_unit == BendingUnit::thickness)
    thickness_ = std::make_shared<const LocalThickness>(samples.points, samples.normals,
                                                        canonical_order(samples.points), samples.sheet_sizes);
}

Vector energy_weights(const SurfaceSamples& samples, const BoundHandles& handles) {
  Vector result = samples.weights;
  for (Index i = 0; i < handles.count(); ++i) {
    if (!handles.handle(i).allow_scale) continue;
    if (result.size() == 0) result.setOnes(samples.size());
    for (Index p = handles.begin(i); p < handles.begin(i + 1); ++p) {
      const Index sample = handles.members()[static_cast<std::size_t>(p)];
      if (sample >= 0) result[sample] = std::min(result[sample], yielding);
    }
  }
  return result;
}

Vector bending_at(const SurfaceSamples& samples, const SurfaceStiffness& stiffness) {
  const Vector result = stiffness.bending(samples.points);
  return samples.bend_weights.size() > 0 ? Vector(result.cwiseProduct(samples.bend_weights)) : result;
}

Vector SurfaceStiffness::bending(PointsIn points) const {
  if (!thickness_) return Vector::Constant(points.rows(), bending_);
  return bending_ * thickness_->at(points).array().square();
}

}  // namespace arapfields
