// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/sample_weights.h"

#include <memory>

#include "core/errors.h"
#include "mesh/sample_mesh.h"
#include "sampling/nearest_sample.h"

namespace arapfields {
namespace {

Vector unless_ones(const Vector& weights) { return (weights.array() == 1.0).all() ? Vector() : weights; }

}  // namespace

SurfaceSamples with_weights(const SurfaceSamples& samples, const Vector& weights,
                            const Vector& bend_weights) {
  require_weights("weights", weights, samples.size());
  require_weights("bend_weights", bend_weights, samples.size());
  require(weights.size() == 0 || weights.maxCoeff() > 0.0, "weights", "all are 0", "some must be above 0");
  SurfaceSamples result = samples;
  result.weights = unless_ones(weights);
  result.bend_weights = unless_ones(bend_weights);
  if (!samples.redraw || samples.size() == 0) return result;
  const auto nearest = std::make_shared<const SignedDistance>(nearest_samples(samples.points));
  result.redraw = [nearest, draw = samples.redraw, w = result.weights, b = result.bend_weights](
                      Index count, std::uint64_t seed) {
    SurfaceSamples drawn = draw(count, seed);
    drawn.weights.resize(w.size() > 0 ? count : 0);
    drawn.bend_weights.resize(b.size() > 0 ? count : 0);
    const std::vector<std::int32_t> places = nearest->closest(drawn.points).triangles;
    for (Index i = 0; i < count; ++i) {
      if (w.size() > 0) drawn.weights[i] = w[places[i]];
      if (b.size() > 0) drawn.bend_weights[i] = b[places[i]];
    }
    return drawn;
  };
  return result;
}

}  // namespace arapfields
