// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/training_points.h"

#include "core/parallel.h"
#include "mesh/sample_mesh.h"

namespace arapfields {
namespace {

constexpr Index draws_at_once = 4096;

Vec3 displaced(const AreaSampler& sampler, Random& random, double spread) {
  const Vec3 place = sampler.draw(random).point;
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return (place + spread * Vec3(x, y, z)).cwiseMax(-1.0).cwiseMin(1.0);
}

Vec3 anywhere(Random& random) {
  const double x = random.uniform(-1.0, 1.0), y = random.uniform(-1.0, 1.0), z = random.uniform(-1.0, 1.0);
  return {x, y, z};
}

}  // namespace

TrainingPoints training_points(const SignedDistance& distance, const TriangleMesh& mesh, const Frame& frame,
                               const TrainingPointsOptions& options, std::uint64_t seed,
                               const Progress& progress) {
  options.validate();
  const AreaSampler sampler(frame.to_cube(mesh.vertices), mesh.triangles);

  const Index near = options.near_points, count = near + options.uniform_points;
  TrainingPoints result{PointsF(count, 3), VectorF(count), near};
  parallel_for(0, count, draws_at_once, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Random random(seed, static_cast<std::uint64_t>(i));
      const double spread = i % 2 == 0 ? options.near_spread : options.far_spread;
      const Vec3 point = i < near ? displaced(sampler, random, spread) : anywhere(random);
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
