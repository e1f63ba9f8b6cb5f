// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/style.h"

#include <algorithm>

#include "core/errors.h"

namespace arapfields {
namespace {

/// Weight of ‖ñ − t‖² relative to 1 − g, which near a preferred normal is 5/2 ‖ñ − n_k‖² at the cube's
/// sharpness; a little more, as targets are fixed, gives a cube's style the same mean g.
constexpr double target_factor = 3.0;
/// Sharpness that stands for ObjectStyle::usual_smoothing, and the largest smoothing, in radians.
constexpr double usual_sharpness = 5.0, widest = 0.8;
/// Distance of unit vectors that count as equal: the precision of meshes in text files.
constexpr double same = 1e-4;

}  // namespace

StyleAtSamples StyleAtSamples::of(const Style& style, PointsIn normals, double sharpness) {
  StyleAtSamples result;
  if (!style.object) {
    result.preference = gauss_preference(style.preferred, sharpness);
    result.weights = result.preference->falloff(normals);
    result.factor = result.preference->balance;
    return result;
  }
  require_sharpness(sharpness);
  const double smoothing =
      ObjectStyle::usual_smoothing * (sharpness > 0.0 ? usual_sharpness / sharpness : 1.0);
  result.targets = style.object->normals(normals, std::min(smoothing, widest));
  result.weights = Vector::Ones(normals.rows());
  if (sharpness == 0.0)
    for (Index i = 0; i < normals.rows(); ++i)
      result.weights[i] = falloff_at(result.targets.row(i).dot(normals.row(i)));
  result.factor = target_factor;
  return result;
}

bool StyleAtSamples::idle(PointsIn normals) const {
  return !preference && (targets.rows() == 0 || (targets - normals).rowwise().norm().maxCoeff() < same);
}

}  // namespace arapfields
