// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/measure.h"

#include <utility>

#include "distance/morton.h"
#include "sampling/sample_choice.h"
#include "wrap/flow.h"
#include "wrap/parameters.h"

namespace arapfields {

MovedSurface::MovedSurface(const DeformationField& field, PointsIn surface, PointsIn surface_normals)
    : jacobians(surface.rows(), 9) {
  const Index count = surface.rows();
  JetBlock<double> jets(count, JetOrder::first);
  field.evaluate(surface, jets.view());
  distortion = arapfields::distortion<double>(std::as_const(jets).view());
  points = Eigen::Map<const Points>(jets.view().data, count, 3);
  for (Index i = 0; i < count; ++i)
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) jacobians(i, 3 * l + k) = jets.view().at(first_column(k), i)[l];
  normals = moved_normals(jacobians, surface_normals, growth);
}

void measure(const DeformationField& field, PointsIn surface, PointsIn surface_normals,
             const WrapTarget& target, WrapReport& report) {
  using namespace wrap_parameters;
  Random random(0);
  const std::vector<Index> rows = stratified(morton_order(surface), measured_samples, random);
  const Points points = rows_of(surface, rows);
  const MovedSurface moved(field, points, rows_of(surface_normals, rows));
  report.distortion = moved.distortion;
  const SurfaceDistances to = surface_distances(target.tree, target.points, target.normals, target.spacing,
                                                moved.points, moved.normals, moved.growth, target.interior);
  const OrientedPoints tree(moved.points, moved.normals);
  const SurfaceDistances from = surface_distances(
      tree, moved.points, moved.normals, mean_spacing(moved.points), target.points, target.normals, {}, {});
  report.to_target_mean = to.mean / target.diagonal;
  report.to_target_95 = to.quantile_95 / target.diagonal;
  report.from_target_mean = from.mean / target.diagonal;
  report.from_target_95 = from.quantile_95 / target.diagonal;
  const Points some = rows_of(points, random_subset(points.rows(), energy_samples, random));
  JetBlock<double> second(some.rows(), JetOrder::second);
  field.evaluate(some, second.view());
  report.arap = arap_energy<double>(std::as_const(second).view(), 1.0, 0.0, {});
}

}  // namespace arapfields
