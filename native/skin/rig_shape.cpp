// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/rig_shape.h"

#include <cmath>
#include <numbers>

#include "sampling/canonical_order.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

constexpr Index most_nodes = 4000;
/// Within so many spacings nodes count as neighbours.
constexpr double neighbour_spacings = 2.5;
/// In sizes of the shape, how closely bones are mirrored.
constexpr double symmetric_bones = 5e-3;

const SurfaceSamples& checked(const SurfaceSamples& samples) {
  require_samples(samples);
  require(samples.normals.rows() == samples.size(), "samples", "no normals", "each needs one");
  return samples;
}

}  // namespace

RigShape::RigShape(const SurfaceSamples& surface, const std::vector<Bone>& bones, const Progress& progress)
    : samples(checked(surface)), skeleton(bones), handles(bone_handles(samples, skeleton)) {
  const Points points = samples.frame.to_mesh(samples.points);
  const std::vector<Index> chosen = evenly(canonical_order(samples.points), most_nodes);
  nodes = rows_of(points, chosen);
  normals = rows_of(samples.normals, chosen);
  extent = body_size(points);
  // A sphere's area by its radius of gyration.
  symmetry = skeleton.symmetry(symmetric_bones * extent);
  for (Index b = 0; b < skeleton.count(); ++b) {
    const Index other = symmetry.mirrored[b];
    const double middle = 0.5 * (skeleton.bone(b).head + skeleton.bone(b).tail)[symmetry.axis];
    sides.push_back(other < 0 || other == b ? 0 : middle < symmetry.offset ? -1 : 1);
  }
  spacing = std::sqrt(4.0 * std::numbers::pi / static_cast<double>(size())) * extent / 2.5;
  progress.check();
  const InteriorGraph graph(nodes, normals, spacing);
  progress.check();
  bone_distances = interior_bone_distances(graph, BoneRegions(skeleton, nodes, normals));
  neighbours.resize(size());
  for (Index i = 0; i < size(); ++i) {
    double total = 0.0;
    for (const auto& edge : graph.edges(i)) {
      const double away = static_cast<double>(edge.length) / spacing;
      if (away > neighbour_spacings) continue;
      neighbours[i].emplace_back(edge.to, std::exp(-away * away));
      total += neighbours[i].back().second;
    }
    for (auto& [to, weight] : neighbours[i]) weight /= total;
  }
}

}  // namespace arapfields
