// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/warnings.h"

#include <cmath>
#include <cstdio>

#include "core/errors.h"

namespace arapfields {
namespace {

constexpr double far_in_sizes = 5.0, farthest_in_sizes = 1e6;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace

std::optional<FarTarget> far_target(const BoundHandles& handles, PointsIn samples) {
  const double size = (samples.colwise().maxCoeff() - samples.colwise().minCoeff()).maxCoeff();
  FarTarget farthest{-1, far_in_sizes};
  for (Index i = 0; i < handles.count(); ++i) {
    const Index begin = handles.begin(i), rows = handles.begin(i + 1) - begin;
    const Points way = handles.targets().middleRows(begin, rows) - handles.sources().middleRows(begin, rows);
    const double sizes = way.rowwise().stableNorm().maxCoeff() / size;
    if (std::isfinite(sizes) && sizes > farthest.sizes) farthest = {i, sizes};
  }
  if (farthest.handle < 0) return std::nullopt;
  return farthest;
}

void require_within_reach(const BoundHandles& handles, PointsIn samples) {
  const std::optional<FarTarget> far = far_target(handles, samples);
  if (far)
    require(far->sizes <= farthest_in_sizes, "handles[" + std::to_string(far->handle) + "]",
            "its target is " + number(far->sizes) + " times the shape's size away from its place at rest",
            "at most " + number(farthest_in_sizes) + " times is allowed");
}

std::vector<std::string> warnings_on(const Distortion& distortion, const std::optional<FarTarget>& far,
                                     const BoundHandles& handles) {
  std::vector<std::string> warnings;
  if (distortion.flipped_share > 0.0)
    warnings.push_back("the result folds: det J is not positive at " +
                       number(100.0 * distortion.flipped_share) + " % of the samples, " +
                       number(distortion.min_determinant) + " at the worst");
  if (far)
    warnings.push_back("handles[" + std::to_string(far->handle) + "]: its target is " + number(far->sizes) +
                       " times the shape's size away from its place at rest");
  for (Index i = 0; i < handles.count(); ++i)
    if (handles.brought(i) > 0.0)
      warnings.push_back("handles[" + std::to_string(i) + "]: its point lies " + number(handles.brought(i)) +
                         " times the shape's size off the surface, whose nearest place it moves instead");
  return warnings;
}

}  // namespace arapfields
