// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/rest_shape.h"

#include "core/random.h"
#include "fields/mirror.h"
#include "sampling/sample_choice.h"
#include "solve/contact/points.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

constexpr Index most_sites = 6000;
/// Centers' spacing is proportional to the square root of the thickness, clamped below at this fraction of
/// its median.
constexpr double least_size = 0.1;
/// The random stream that chooses the sites.
constexpr std::uint64_t site_stream = 2;

}  // namespace

RestShape::RestShape(const SurfaceSamples& samples, bool interior, std::uint64_t seed,
                     const Progress& progress, int axis, const MayJoin& may_join)
    : seed_(seed) {
  require_samples(samples);
  progress.check();
  order = canonical_order(samples.points);
  progress.check();
  thickness =
      std::make_shared<const LocalThickness>(samples.points, samples.normals, order, samples.sheet_sizes);
  progress.check();
  Random random(seed, site_stream);
  std::vector<Index> chosen = stratified(order, most_sites, random);
  const std::vector<Index> missed = missed_rows(samples.points, chosen);
  chosen.insert(chosen.end(), missed.begin(), missed.end());
  sites = rows_of(samples.points, chosen);
  const Vector thick = thickness->at(sites);
  layout.sizes = (thick / thickness->median()).cwiseMax(least_size).cwiseSqrt();
  Points normals(0, 3);
  if (samples.normals.rows() == samples.size()) {
    normals = rows_of(samples.normals, chosen);
    layout.inner = sites - thick.asDiagonal() * normals;
  }
  if (axis >= 0) {
    FoldedPoints half = folded(sites, normals, layout, axis);
    sites = std::move(half.points);
    normals = std::move(half.normals);
    layout = std::move(half.layout);
  }
  parts = parts_of(sites);
  if (!interior || normals.rows() == 0) return;
  progress.check();
  const MayJoin sites_may_join = [&](Index i, Index j) { return may_join(chosen[i], chosen[j]); };
  std::shared_ptr<const InsideSight> sight;
  const MakeSight make_sight = [&] {
    return sight = std::make_shared<const InsideSight>(*samples.mesh, samples.frame, progress);
  };
  const std::shared_ptr<InteriorEmbedding> made = interior_embedding(
      sites, normals, axis, may_join ? sites_may_join : MayJoin(), samples.mesh ? make_sight : MakeSight());
  if (made && made->sight) {
    // Samples and vertices know their sides by the mesh; other points take that of the nearest of them.
    std::vector<Index> near, near_vertices;
    const std::vector<SurfaceSide> sides = made->sides_of(samples.points, samples.normals, *sight, &near);
    std::vector<SurfaceSide> of_vertices =
        made->sides_of(*samples.mesh, samples.frame, *sight, &near_vertices);
    Points places(std::ssize(near) + std::ssize(near_vertices), 3);
    places << rows_of(samples.points, near),
        samples.frame.to_cube(rows_of(samples.mesh->vertices, near_vertices));
    std::vector<SurfaceSide> near_sides;
    for (const Index i : near) near_sides.push_back(sides[static_cast<std::size_t>(i)]);
    for (const Index i : near_vertices) near_sides.push_back(of_vertices[static_cast<std::size_t>(i)]);
    made->sight->keep(samples.mesh, std::move(of_vertices));
    made->sight->set_places(places, std::move(near_sides));
  }
  embedding = made;
}

std::shared_ptr<const FollowedPlaces> RestShape::followed(const SurfaceSamples& samples,
                                                          const Progress& progress) const {
  return followed_.run(progress, [&](std::shared_ptr<const FollowedPlaces>& made) {
    if (!made) made = std::make_shared<const FollowedPlaces>(samples, order, seed_, progress);
    return made;
  });
}

}  // namespace arapfields
