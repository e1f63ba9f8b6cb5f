// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/rest_shape.h"

#include "core/random.h"
#include "fields/mirror.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"
#include "solve/contact/points.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

constexpr Index most_sites = 6000;
/// Centers' spacing is proportional to the square root of the thickness, clamped below at this fraction of
/// its median.
constexpr double least_size = 0.1;
/// Factor on the centers' spacing in fine regions.
constexpr double finer_centers = 0.4;
/// Points of a fine region for each candidate.
constexpr Index points_a_site = 3;
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
  Points normals(0, 3);
  if (samples.normals.rows() == samples.size()) normals = rows_of(samples.normals, chosen);
  lay_out(normals);
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
    if (!sight) sight = std::make_shared<const InsideSight>(*samples.mesh, samples.frame, progress);
    return sight;
  };
  const std::shared_ptr<InteriorEmbedding> made = interior_embedding(
      sites, normals, axis, may_join ? sites_may_join : MayJoin(), samples.mesh ? make_sight : MakeSight());
  if (made && !may_join) {
    fine_regions = arapfields::fine_regions(samples, *thickness, made->width, progress);
    if (axis >= 0)
      std::erase_if(fine_regions,
                    [&](const FineRegion& region) { return region.points.col(axis).minCoeff() <= 0.0; });
    if (!fine_regions.empty()) refine(*made, normals, make_sight, axis, progress);
    progress.check();
  }
  if (made && made->has_sides()) {
    SidedPlaces known;
    known.add(samples.points, samples.normals, samples.points);
    for (const FineRegion& region : fine_regions)  // some of these are samples of the energy
      known.add(region.points, region.normals, region.points, region.shares);
    known.add(sites, normals, layout.inner);  // centers of the second layer
    if (axis >= 0) {
      Points reflected[] = {sites, normals, layout.inner};
      for (Points& points : reflected) points.col(axis) *= -1.0;
      known.add(reflected[0], reflected[1], reflected[2]);
    }
    made->look_at(known, samples.mesh, samples.frame, *sight);
    layout.embedded.resize(sites.rows(), 3);
    made->evaluate(sites, {layout.embedded.data(), sites.rows(), JetOrder::value});
  }
  embedding = made;
}

void RestShape::lay_out(const Points& normals) {
  const Vector thick = thickness->at(sites);
  layout.sizes = (thick / thickness->median()).cwiseMax(least_size).cwiseSqrt();
  if (normals.rows() > 0) layout.inner = sites - thick.asDiagonal() * normals;
}

void RestShape::refine(InteriorEmbedding& own, Points& normals, const MakeSight& make_sight, int axis,
                       const Progress& progress) {
  add_parts(own, fine_regions, make_sight, axis, progress);
  for (const FineRegion& region : fine_regions) {
    std::vector<Index> rows;
    for (Index i = 0; i < region.points.rows(); i += points_a_site)
      if (region.shares[i] > 0.0) rows.push_back(i);
    const Index before = sites.rows(), more = std::ssize(rows);
    const auto nearest = nearest_samples(sites).closest(region.points(rows, Eigen::all)).triangles;
    sites.conservativeResize(before + more, Eigen::NoChange);
    sites.bottomRows(more) = region.points(rows, Eigen::all);
    normals.conservativeResize(before + more, Eigen::NoChange);
    normals.bottomRows(more) = region.normals(rows, Eigen::all);
    for (const std::int32_t row : nearest) parts.push_back(parts[static_cast<std::size_t>(row)]);
  }
  for (std::size_t k = 0, one_sided = fine_regions.size(); axis >= 0 && k < one_sided; ++k)
    fine_regions.push_back(fine_regions[k].reflected(axis));
  const auto finer = std::make_shared<LocalThickness>(*thickness);
  for (const FineRegion& region : fine_regions) {
    progress.check();
    finer->refine(region);
  }
  thickness = finer;
  lay_out(normals);
  if (axis >= 0) layout.inner.col(axis) = layout.inner.col(axis).cwiseAbs().eval();
  for (const FineRegion& region : fine_regions)
    layout.sizes.array() *= 1.0 - (1.0 - finer_centers) * region.shares_at(sites).array();
}

std::shared_ptr<const FollowedPlaces> RestShape::followed(const SurfaceSamples& samples,
                                                          const Progress& progress) const {
  return followed_.run(progress, [&](std::shared_ptr<const FollowedPlaces>& made) {
    if (!made) made = std::make_shared<const FollowedPlaces>(samples, order, seed_, progress);
    return made;
  });
}

}  // namespace arapfields
