// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/style.h"

#include <algorithm>

#include "core/errors.h"

namespace arapfields {
namespace {

/// Of ‖ñ − t‖² against 1 − g: near a preferred normal 1 − g is 5/2 ‖ñ − n_k‖² at the cube's sharpness;
/// somewhat more, since targets are fixed, lets a cube's style reach the same mean g.
constexpr double target_factor = 3.0;
/// Sharpness at which an object is smoothed as usual, and the widest smoothing.
constexpr double usual_sharpness = 5.0, widest = 0.8;
/// Directions this near to each other are the same to the precision of meshes in text files.
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
