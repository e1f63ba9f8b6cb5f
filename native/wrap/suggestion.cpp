// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/suggestion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/errors.h"
#include "core/parallel.h"
#include "fields/interior_distance.h"
#include "fields/radial_basis.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"
#include "solve/setup.h"
#include "wrap/alignment.h"
#include "wrap/flow.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

/// Nodes of the graph of interior distances, and the sources whose mean distance each node gets.
constexpr Index most_nodes = 1200, mean_sources = 64;
/// An extremity has the largest mean distance within this fraction of the longest interior distance.
constexpr double end_reach = 0.12;
/// Extremities that the wrap brings within this fraction of the target's diagonal correspond.
constexpr double same_end = 0.1;
/// Options of the coarse wrap.
constexpr int suggestion_centers = 200, suggestion_stages = 4, suggestion_iterations = 4;

/// Farthest-point samples in interior distance, in the order of their choice, and which are extremities.
struct FarPlaces {
  Points points, normals;
  std::vector<bool> is_end;

  FarPlaces(PointsIn samples, PointsIn sample_normals, Index count, const Progress& progress) {
    const FarthestPoints chosen = farthest_points(samples, std::min<Index>(most_nodes, samples.rows()));
    const auto nodes = static_cast<Index>(chosen.indices.size());
    const Points places = rows_of(samples, chosen.indices), sides = rows_of(sample_normals, chosen.indices);
    const InteriorGraph graph(places, sides, chosen.fill_distance);
    progress.check();
    const RowMatrix<double> from = graph.distances(std::min(mean_sources, nodes));
    const Vector means = from.rowwise().mean();
    const double reach = end_reach * from.maxCoeff();
    Vector nearest = means;  // the first sample has the largest mean distance
    std::vector<Index> rows;
    for (Index k = 0; k < std::min(count, nodes); ++k) {
      Index row = 0;
      if (!(nearest.maxCoeff(&row) > 0.0)) break;
      if (k == 0) nearest.setConstant(std::numeric_limits<double>::infinity());
      std::vector<float> start(nodes, std::numeric_limits<float>::infinity());
      start[row] = 0.0F;
      const std::vector<float> distances = graph.distances_from(std::move(start));
      bool largest = true;
      for (Index i = 0; i < nodes; ++i) {
        nearest[i] = std::min(nearest[i], static_cast<double>(distances[i]));
        if (distances[i] < reach && means[i] > means[row]) largest = false;
      }
      rows.push_back(row);
      is_end.push_back(largest);
      progress.check();
    }
    points = rows_of(places, rows);
    normals = rows_of(sides, rows);
  }
};

}  // namespace

std::vector<Landmark> suggest_landmarks(const SurfaceSamples& samples, const ImplicitFunction& function,
                                        int count, const WrapOptions& given, const Progress& progress) {
  given.validate();
  require_samples(samples);
  require(samples.normals.rows() == samples.size(), "samples", "they have no normals",
          "one a sample is needed");
  require(count > 0, "count", std::to_string(count), "at least 1 is needed");
  WrapOptions options = given;
  options.centers = std::min(options.centers, suggestion_centers);
  options.stages = suggestion_stages;
  options.iterations = suggestion_iterations;
  const ThreadScope threads(options.threads);
  const auto seed = static_cast<std::uint64_t>(options.seed);

  // A wrap without landmarks takes the source's places to the target.
  const WrapTarget target = wrap_target(function, flow_target_samples, seed, progress.part(0.0, 0.2));
  const FarPlaces here(samples.points, samples.normals, count, progress);
  WrapSource source{samples.points, samples.normals, Points(0, 3), Points(0, 3), samples.frame};
  std::vector<std::string> warnings;
  const Similarity placement = wrap_alignment(source, target, options.alignment, options.normal_weight,
                                              warnings, progress.part(0.2, 0.4));
  const WrapTarget placed = target.transformed_back(placement);
  WrapFlow flow(samples, placed, here.points, here.points, {}, seed);
  flow.run(options, progress.part(0.4, 0.9), {}, coarse_sliding);
  const Points moved = placement.of(flow.landmarks());

  // The images' nearest points of the target, or its extremities next to them.
  const FarPlaces there(target.points, target.normals, 2 * count, progress);
  const std::vector<Index> landed =
      target.tree.nearest(moved, here.normals * placement.rotation.transpose(), 0.0);
  std::vector<Landmark> result;
  for (Index i = 0; i < moved.rows(); ++i) {
    Vec3 place = target.points.row(landed[i]);
    double nearest = same_end * target.diagonal;
    for (Index k = 0; here.is_end[i] && k < there.points.rows(); ++k) {
      const double distance = (there.points.row(k) - moved.row(i)).norm();
      const bool is_mutual = (moved.rowwise() - there.points.row(k)).rowwise().norm().minCoeff() >= distance;
      if (!there.is_end[k] || !is_mutual || distance >= nearest) continue;
      nearest = distance;
      place = there.points.row(k);
    }
    result.push_back({samples.frame.to_mesh(here.points.row(i)).row(0), place});
  }
  progress.report(1.0, "done");
  return result;
}

}  // namespace arapfields
