// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/followed_places.h"

#include <algorithm>
#include <cmath>

#include "core/point_grid.h"
#include "core/random.h"
#include "core/unit_rows.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "sampling/standing_out.h"

namespace arapfields {
namespace {

/// Most contact samples; they are denser than any detail of a radial field.
constexpr Index most_samples = 14000;
/// Mesh vertices farther than this from the samples' surface, in cube units, become contact points; nearer
/// ones are within the safety distance of contact.
constexpr double stands_out = 1e-3;
constexpr Index most_vertices = 4000;
/// The random stream that chooses the samples.
constexpr std::uint64_t sample_stream = 3;

}  // namespace

FollowedPlaces::FollowedPlaces(const SurfaceSamples& surface, const std::vector<std::uint32_t>& order,
                               std::uint64_t seed, const Progress& progress) {
  Random random(seed, sample_stream);
  samples = stratified(order, std::min(most_samples, surface.size()), random);
  rest = rows_of(surface.points, samples);
  const double wide = 0.05;  // a cell holds about wide² of the surface's area
  const PointGrid coarse(rest, wide);
  spacing = wide * std::sqrt(static_cast<double>(coarse.size()) / static_cast<double>(rest.rows()));
  if (!surface.mesh) return;
  Points normals = Points::Zero(rest.rows(), 3);
  if (surface.normals.rows() == surface.size()) normals = unit_rows(rows_of(surface.normals, samples));
  const Points vertices =
      surface.frame.to_cube(used_vertices(surface.mesh->vertices, surface.mesh->triangles));
  const Points found =
      rows_of(vertices, standing_out(vertices, rest, normals, spacing, stands_out, most_vertices, progress));
  const Points alike = Points::Zero(std::max(rest.rows(), found.rows()), 3);
  parents = OrientedPoints(rest, alike.topRows(rest.rows())).nearest(found, alike.topRows(found.rows()), 0.0);
  rest.conservativeResize(rest.rows() + found.rows(), Eigen::NoChange);
  rest.bottomRows(found.rows()) = found;
}

}  // namespace arapfields
