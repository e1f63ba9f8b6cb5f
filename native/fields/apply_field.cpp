// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/apply_field.h"

#include <cmath>
#include <string>

#include "core/errors.h"
#include "sampling/nearest_sample.h"

namespace arapfields {
namespace {

/// Largest distance from the surface, in sizes of it, and the fraction of the points that may be beyond.
constexpr double near_share = 0.1, most_outside = 0.1;

}  // namespace

Points apply_field(const DeformationField& field, PointsIn points, double strength,
                   const Triangles* triangles) {
  if (triangles != nullptr) validate(points, *triangles);
  require(points.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  require_range("strength", strength, -10.0, 10.0);
  const Points& rest = field.rest_points();
  if (rest.rows() > 1 && points.rows() > 0) {
    const double near = near_share * body_size(rest);
    const Points placed = field.frame().to_cube(points);
    const Vector distances = nearest_distances(rest, placed);
    // Points deep inside, such as teeth and bones, are in the surface's bounding box.
    const Eigen::RowVector3d low = rest.colwise().minCoeff(), high = rest.colwise().maxCoeff();
    Index outside = 0;
    for (Index i = 0; i < points.rows(); ++i)
      if (distances[i] > near &&
          ((placed.row(i) - low).minCoeff() < 0.0 || (high - placed.row(i)).minCoeff() < 0.0))
        ++outside;
    const double share = static_cast<double>(outside) / static_cast<double>(points.rows());
    if (share > most_outside)
      throw InvalidInput("points",
                         std::to_string(std::lround(100.0 * share)) +
                             " % of them lie outside of the field, farther than " +
                             number_text(near * field.frame().scale) + " from the surface it was solved on",
                         "a mesh of the same shape, in the same place and size, is needed; what goes along "
                         "with the body is carried by an Attachment");
  }
  const Points moved = triangles != nullptr ? field.at_vertices({points, *triangles}) : field.at(points);
  if (strength == 1.0) return moved;
  return points + strength * (moved - points);
}

}  // namespace arapfields
