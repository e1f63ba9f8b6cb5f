// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/problem.h"

#include <numeric>

#include "core/random.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Samples × centers below which a solve is single-threaded: an iteration then takes about a millisecond, and
/// waking threads costs more than they save.
constexpr Index worth_threads = 1000000;
/// Least number of fine centers for a second layer in live solves (docs/notes/centers.md). With fewer, basis
/// functions are wider than the distance of the layers and nearly dependent: solves take 1.5 times as many
/// iterations. Shapes with fine regions get as many: with a single layer and fewer, a finger's base turns the
/// fingers beside it.
constexpr int worth_two_layers = 400;
/// A place of the mesh that is no farther from a sample, in cube units, is that sample.
constexpr double same_place = 1e-9;
/// Samples of the energy that a fine region gets besides, as a share of all others, and all of them together,
/// but each at least so many.
constexpr double share_in_region = 0.1, share_in_all = 0.3;
constexpr Index least_in_region = 400;

}  // namespace

RadialProblem::RadialProblem(const SurfaceSamples& surface, const LiveOptions& solver_options,
                             const Progress& progress, std::shared_ptr<const RestShape> rest_shape,
                             std::shared_ptr<const HandleBlend> exact_handles)
    : options(solver_options),
      samples(surface),
      shape(std::move(rest_shape)),
      blend(std::move(exact_handles)) {
  const int axis = axis_of(options.symmetry);
  if (axis >= 0) samples = across(samples, axis);
  require_samples(samples);
  const auto seed = static_cast<std::uint64_t>(options.seed);
  // Deform and stylize, which pass a shape in, evaluate the field off the surface as well. On a flat sheet
  // no function of one layer has a slope across it.
  const bool off_surface = shape || samples.sheet_sizes.size() > 0;
  if (!shape) shape = std::make_shared<const RestShape>(samples, options.interior, seed, progress, axis);
  const int fine_centers =
      shape->fine_regions.empty() ? options.fine_centers : std::max(options.fine_centers, worth_two_layers);
  const bool two_layers = off_surface || fine_centers >= worth_two_layers;
  Random random(seed);
  const std::vector<Index> chosen = stratified(shape->order, options.samples, random);
  add_energy_samples(chosen);
  add_energy_samples(missed_rows(samples.points, chosen));
  if (!shape->fine_regions.empty()) refine();
  std::vector<RadialScale> scales;
  if (options.coarse_centers > 0) scales.push_back({options.coarse_centers, options.coarse_radius_factor});
  scales.push_back({fine_centers, options.fine_radius_factor, two_layers});
  if (axis >= 0) {
    mirror.emplace();
    mirror->axis = axis;
    basis = mirrored_basis({shape->sites, Points(0, 3), shape->layout}, scales, *mirror);
  } else {
    basis = radial_basis(shape->sites, scales, shape->layout);
  }
  if (options.interior) basis.set_embedding(shape->embedding);
  progress.report(0.2, "centers placed");
  stiffness = SurfaceStiffness(shape->thickness, options.surface);
}

void RadialProblem::add_energy_samples(const std::vector<Index>& rows) {
  energy_samples.insert(energy_samples.end(), rows.begin(), rows.end());
  energy_points = rows_of(surface(), energy_samples);
  ++energy_revision;
}

void RadialProblem::refine() {
  const std::vector<FineRegion>& regions = shape->fine_regions;
  const Index before = samples.size();
  const double share = std::min(share_in_region, share_in_all / static_cast<double>(regions.size()));
  const Index most = std::max<Index>(least_in_region, static_cast<Index>(share * options.samples));
  MeshPlaces places;
  std::vector<std::size_t> region_of;
  for (const FineRegion& region : regions) {
    const std::vector<Index> picked = evenly(region.points.rows(), most);
    const Index first = std::ssize(region_of), count = first + std::ssize(picked);
    places.points.conservativeResize(count, Eigen::NoChange);
    places.points.bottomRows(count - first) = frame().to_mesh(Points(region.points(picked, Eigen::all)));
    places.normals.conservativeResize(count, Eigen::NoChange);
    places.normals.bottomRows(count - first) = region.normals(picked, Eigen::all);
    region_of.resize(static_cast<std::size_t>(count), static_cast<std::size_t>(&region - regions.data()));
  }
  const std::vector<Index> added = add_samples(places);
  if (areas.size() == 0) areas = Vector::Ones(samples.size());
  // The energy stays a mean over the area: all samples of a region share that of the former ones.
  for (std::size_t r = 0; r < regions.size(); ++r) {
    std::vector<Index> rows;
    for (std::size_t k = 0; k < added.size(); ++k)
      if (region_of[static_cast<std::size_t>(added[k])] == r) rows.push_back(before + static_cast<Index>(k));
    const std::vector<Index> former = regions[r].rows_on(energy_points);
    const auto all = static_cast<double>(former.size() + rows.size());
    const double left = static_cast<double>(former.size()) / all;
    for (const Index row : rows) areas[row] = left;
    for (const Index k : former) areas[energy_samples[static_cast<std::size_t>(k)]] *= left;
    add_energy_samples(rows);
  }
}

std::vector<Index> RadialProblem::add_samples(const MeshPlaces& places) {
  const auto found = nearest_samples(samples.points).closest(frame().to_cube(places.points));
  std::vector<Index> rows, nearest, like;
  for (Index i = 0; i < places.points.rows(); ++i) {
    if (found.distances[i] < same_place) continue;
    rows.push_back(i);
    nearest.push_back(found.triangles[static_cast<std::size_t>(i)]);
    const Index added = nearest.back() - given_count();
    like.push_back(added < 0 ? nearest.back() : alike[static_cast<std::size_t>(added)]);
  }
  const Points points = frame().to_cube(rows_of(places.points, rows));
  const Points normals = rows_of(places.normals, rows);
  const Index before = samples.size(), count = before + points.rows();
  const auto repeat = [&](auto& values) {
    if (values.size() == 0) return;
    values.conservativeResize(count);
    for (Index i = before; i < count; ++i) values[i] = values[nearest[static_cast<std::size_t>(i - before)]];
  };
  samples.points.conservativeResize(count, Eigen::NoChange);
  samples.points.bottomRows(points.rows()) = points;
  if (samples.normals.rows() > 0) {
    samples.normals.conservativeResize(count, Eigen::NoChange);
    for (Index i = before; i < count; ++i) {  // faces may point inwards, samples' normals do not
      const auto near = samples.normals.row(nearest[static_cast<std::size_t>(i - before)]);
      const auto own = normals.row(i - before);
      samples.normals.row(i) = (own.dot(near) < 0.0 ? -1.0 : 1.0) * own;
    }
  }
  repeat(areas);
  repeat(samples.weights);
  repeat(samples.bend_weights);
  repeat(samples.sheet_sizes);
  if (!samples.mesh_indices.empty())
    for (const Index row : nearest)
      samples.mesh_indices.push_back(samples.mesh_indices[static_cast<std::size_t>(row)]);
  alike.insert(alike.end(), like.begin(), like.end());
  return rows;
}

Vector RadialProblem::at_all(const std::string& argument, const Vector& given) const {
  if (given.size() == 0) return given;
  const Index count = given_count();
  require(given.size() == count, argument, std::to_string(given.size()) + " numbers",
          "one weight for each of the " + std::to_string(count) + " samples, or none, is needed");
  Vector result(samples.size());
  result << given, entries_of(given, alike);
  return result;
}

SurfaceSamples RadialProblem::given_samples() const {
  SurfaceSamples result = samples;
  const Index count = given_count();
  const auto cut = [&](auto& values) {
    if (values.size() > 0) values.conservativeResize(count);
  };
  result.points.conservativeResize(count, Eigen::NoChange);
  if (result.normals.rows() > 0) result.normals.conservativeResize(count, Eigen::NoChange);
  cut(result.weights);
  cut(result.bend_weights);
  cut(result.sheet_sizes);
  if (!result.mesh_indices.empty()) result.mesh_indices.resize(static_cast<std::size_t>(count));
  return result;
}

Vector RadialProblem::energy_areas() const {
  if (areas.size() == 0) return areas;
  const Vector own = entries_of(areas, energy_samples);
  return own / own.mean();
}

int RadialProblem::solve_threads() const {
  const Index work = energy_points.rows() * basis.center_count();
  return options.threads == 0 && work < worth_threads ? 1 : options.threads;
}

}  // namespace arapfields
