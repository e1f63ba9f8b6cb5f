// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/curve_samples.h"

#include <cmath>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/memory.h"

namespace arapfields {

CurveSamples sample_curve(Points2In vertices, Index count, bool closed) {
  const Index least = closed ? 3 : 2;
  require(vertices.rows() >= least, "vertices", std::to_string(vertices.rows()) + " vertices",
          closed ? "a closed curve has three or more" : "an open curve has two or more");
  require(vertices.allFinite(), "vertices", "some are NaN or infinite", "all must be finite");
  require(count >= 1, "count", std::to_string(count), "must be positive");
  require_memory("count", 4.0 * sizeof(double) * static_cast<double>(count));

  const Index edges = closed ? vertices.rows() : vertices.rows() - 1;
  std::vector<double> arc_lengths(edges);  // from the first vertex to each edge's end
  double length = 0.0, twice_area = 0.0;   // the area by the shoelace formula, above 0 counterclockwise
  for (Index e = 0; e < edges; ++e) {
    const Vec2 a = vertices.row(e), b = vertices.row((e + 1) % vertices.rows());
    length += (b - a).norm();
    twice_area += a.x() * b.y() - a.y() * b.x();
    arc_lengths[e] = length;
  }
  require(length > 0, "vertices", "all are the same point", "a curve has a length");
  require(std::isfinite(length), "vertices", "their distances are too large for floating point",
          "the curve's length must be finite");
  const double outward = closed && twice_area < 0 ? -1.0 : 1.0;

  CurveSamples samples{Points2(count, 2), Points2(count, 2)};
  Index e = 0;
  for (Index s = 0; s < count; ++s) {
    const double arc_length = length * (static_cast<double>(s) + 0.5) / static_cast<double>(count);
    while (e + 1 < edges && arc_lengths[e] < arc_length) ++e;
    const Vec2 a = vertices.row(e), b = vertices.row((e + 1) % vertices.rows());
    const Vec2 direction = (b - a).normalized();
    samples.points.row(s) = b - (arc_lengths[e] - arc_length) * direction;
    samples.normals.row(s) = outward * Vec2(direction.y(), -direction.x());
  }
  return samples;
}

}  // namespace arapfields
