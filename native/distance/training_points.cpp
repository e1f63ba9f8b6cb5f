// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/training_points.h"

#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "mesh/sample_mesh.h"

namespace arapfields {
namespace {

constexpr Index grain = 4096;

void require_spread(double spread, const char* name) {
  require(std::isfinite(spread) && spread > 0.0, name, std::to_string(spread), "must be above zero");
}

Vec3 displaced(const AreaSampler& sampler, Random& random, double spread) {
  const Vec3 on_surface = sampler.draw(random).point;
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return (on_surface + spread * Vec3(x, y, z)).cwiseMax(-1.0).cwiseMin(1.0);
}

Vec3 anywhere(Random& random) {
  const double x = random.uniform(-1.0, 1.0), y = random.uniform(-1.0, 1.0), z = random.uniform(-1.0, 1.0);
  return {x, y, z};
}

}  // namespace

TrainingPoints training_points(const SignedDistance& distance, const TriangleMesh& mesh, const Frame& frame,
                               const TrainingPointsOptions& options, const Progress& progress) {
  require(options.near_surface >= 0 && options.in_volume >= 0, "near_surface, in_volume",
          std::to_string(options.near_surface) + " and " + std::to_string(options.in_volume),
          "counts must not be negative");
  require_spread(options.fine_spread, "fine_spread");
  require_spread(options.coarse_spread, "coarse_spread");
  const AreaSampler sampler(frame.to_cube(mesh.vertices), mesh.triangles);

  const Index count = options.near_surface + options.in_volume;
  TrainingPoints result{PointsF(count, 3), VectorF(count), options.near_surface};
  parallel_for(0, count, grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Random random(options.seed, static_cast<std::uint64_t>(i));
      const double spread = i % 2 == 0 ? options.fine_spread : options.coarse_spread;
      const Vec3 point = i < options.near_surface ? displaced(sampler, random, spread) : anywhere(random);
      result.points.row(i) = point.transpose().cast<float>();
    }
  });
  progress.report(0.1, "training points");
  // Distances belong to the points as the network will see them: after rounding to single precision.
  Vector distances(count);
  distance.evaluate(frame.to_mesh(result.points.cast<double>()), distances, progress.part(0.1, 1.0));
  result.distances = (distances / frame.scale).cast<float>();
  return result;
}

}  // namespace arapfields
