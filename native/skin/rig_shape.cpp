// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/rig_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/signed_distance.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"
#include "skin/bone_regions.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

constexpr Index most_nodes = 4000;
/// Largest distance of neighbours, in node spacings.
constexpr double neighbour_spacings = 2.5;
/// Nodes are compared up to this distance, in spacings: a point's nearest node is at most about one from it,
/// and the values of those within 2.5 are blended.
constexpr double compared_spacings = 3.5;
/// Depth of eyes below the surface, in spacings.
constexpr double eye_spacings = 0.15;
/// Two nodes that do not see each other are on two sides of a gap if the way inside is longer than the
/// straight one by this factor, and by this many spacings; around a bend it is not.
constexpr double gap_ratio = 1.5, gap_spacings = 2.0;
/// Tolerance of mirrored bones, in sizes of the shape.
constexpr double symmetric_bones = 5e-3;

const SurfaceSamples& checked(const SurfaceSamples& samples) {
  require_samples(samples);
  require(samples.normals.rows() == samples.size(), "samples", "no normals", "each needs one");
  return samples;
}

/// The interval of a bone's length whose surroundings it holds rigidly, and the fewest samples it holds.
constexpr double hold_from = 0.3, hold_to = 0.7;
constexpr Index least_held = 12;
/// Points beyond the interval are held if they are nearer to the bone than this fraction of each child's
/// distance.
constexpr float clearly = 0.5f;
/// Least fraction of a surface's nodes that a bone must own to move it, if unrelated parts touch.
constexpr double owning_share = 0.05;
/// Distance, in node spacings, from surfaces of unrelated bones at which trust is 1, and its least value.
constexpr double trusted_spacings = 4.0, least_trust = 1e-3;
/// Unrelated parts touch if more than this fraction of the nodes has a trust below doubtful_trust.
constexpr double doubtful_nodes = 0.03, doubtful_trust = 0.25;
/// Fraction of such nodes above which a surface gets no correctives.
constexpr double doubtful_surface = 0.1;
/// Largest distance of a bone from the shape, in sizes of the shape.
constexpr double farthest = 0.5;

}  // namespace

RigShape::RigShape(const SurfaceSamples& given, const std::vector<Bone>& bones, const Progress& progress,
                   std::vector<Index> pieces)
    : samples(checked(given)), skeleton(bones), tree(skeleton) {
  if (pieces.empty()) pieces.assign(samples.size(), 0);
  surface = {samples.frame.to_mesh(samples.points), samples.normals, std::move(pieces)};
  const std::vector<Index> chosen = evenly(canonical_order(samples.points), most_nodes);
  nodes = {rows_of(surface.points, chosen), rows_of(surface.normals, chosen), {}};
  node_counts_.assign(surface.count(), 0);
  for (const Index i : chosen) {
    nodes.pieces.push_back(surface.pieces[i]);
    ++node_counts_[surface.pieces[i]];
  }
  places_ = OrientedPoints(nodes.points, nodes.normals);
  extent = body_size(surface.points);
  // The mean spacing on a sphere of the same size.
  spacing = std::sqrt(4.0 * std::numbers::pi / static_cast<double>(size())) * extent / 2.5;
  progress.check();
  find_gaps(chosen, progress);
  const InteriorGraph all(nodes.points, nodes.normals, spacing,
                          [&](Index i, Index j) { return !are_apart(i, j); });
  progress.check();
  const BoneRegions regions(skeleton, surface, chosen, spacing, all);
  owners = regions.owner;
  own_bones_ = regions.own_bones;
  pulls = regions.pulls;
  tree = BoneTree(skeleton);
  symmetry = skeleton.symmetry(symmetric_bones * extent);
  for (Index b = 0; b < skeleton.count(); ++b) {
    const Index other = symmetry.mirrored[b];
    double middle = 0.0;
    for (const BonePart& part : skeleton.parts(b))
      middle += 0.5 * (part.start + part.end)[symmetry.axis] / static_cast<double>(skeleton.parts(b).size());
    sides.push_back(other < 0 || other == b ? 0 : middle < symmetry.offset ? -1 : 1);
  }
  set_movers();
  set_trust();
  const InteriorGraph graph(nodes.points, nodes.normals, spacing,
                            [&](Index i, Index j) { return may_join(i, j); });
  progress.check();
  bone_distances = regions.distances(graph);
  neighbours.resize(size());
  for (Index i = 0; i < size(); ++i) {
    double total = 0.0;
    for (const auto& edge : graph.edges(i)) {
      const double distance = static_cast<double>(edge.length) / spacing;
      if (distance > neighbour_spacings) continue;
      if (nodes.pieces[edge.to] != nodes.pieces[i] && stands_alone(nodes.pieces[i])) continue;
      neighbours[i].emplace_back(edge.to, std::exp(-distance * distance));
      total += neighbours[i].back().second;
    }
    for (auto& [to, weight] : neighbours[i]) weight /= total;
  }
  sample_nodes = nearest_nodes(surface);
  set_handles();
}

bool RigShape::are_apart(Index node, Index other) const {
  return !apart_.empty() && std::ranges::binary_search(apart_[node], other);
}

void RigShape::find_gaps(const std::vector<Index>& chosen, const Progress& progress) {
  if (!samples.mesh) return;
  sight_ = std::make_shared<const InsideSight>(*samples.mesh, samples.frame, progress);
  const double reach = compared_spacings * spacing;
  std::vector<std::pair<Index, Index>> pairs;
  for (Index i = 0; i < size(); ++i)
    for (const Index j : places_.within(nodes.points.row(i), reach))
      if (i < j && nodes.pieces[i] == nodes.pieces[j]) pairs.emplace_back(i, j);
  const InsideSight::Eyes eyes =
      sight_->below(rows_of(samples.points, chosen), nodes.normals,
                    Vector::Constant(size(), eye_spacings * spacing / samples.frame.scale));
  progress.check();
  const std::vector<bool> seen = sight_->see(eyes, eyes, pairs);
  progress.check();
  apart_.resize(size());
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (!seen[k]) {
      apart_[pairs[k].first].push_back(pairs[k].second);
      apart_[pairs[k].second].push_back(pairs[k].first);
    }
  for (std::vector<Index>& others : apart_) std::ranges::sort(others);
  const InteriorGraph graph(nodes.points, nodes.normals, spacing,
                            [&](Index i, Index j) { return !are_apart(i, j); });
  parallel_for(0, size(), 16, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      if (apart_[i].empty()) continue;
      std::vector<float> start(size(), std::numeric_limits<float>::infinity());
      start[i] = 0.0f;
      const std::vector<float> lengths = graph.distances_from(
          std::move(start), static_cast<float>(gap_ratio * reach + gap_spacings * spacing));
      std::erase_if(apart_[i], [&](Index j) {
        const double straight = (nodes.points.row(i) - nodes.points.row(j)).norm();
        return static_cast<double>(lengths[j]) < gap_ratio * straight + gap_spacings * spacing;
      });
    }
  });
  if (std::ranges::all_of(apart_, [](const auto& others) { return others.empty(); })) {
    apart_.clear();
    sight_ = nullptr;
  }
}

std::vector<Index> RigShape::nearest_nodes(const PiecePoints& points) const {
  std::vector<Index> result = nearest_on_own(points, nodes, spacing, enough_nodes());
  if (!sight_) return result;
  std::vector<Index> rows;
  for (std::size_t i = 0; i < result.size(); ++i)
    if (!apart_[result[i]].empty()) rows.push_back(static_cast<Index>(i));
  if (rows.empty()) return result;
  const auto eyes_of = [&](PointsIn places, PointsIn normals) {
    return sight_->below(samples.frame.to_cube(places), normals,
                         Vector::Constant(places.rows(), eye_spacings * spacing / samples.frame.scale));
  };
  std::vector<std::pair<Index, Index>> pairs;
  for (std::size_t k = 0; k < rows.size(); ++k)
    for (const Index node : places_.within(points.points.row(rows[k]), neighbour_spacings * spacing))
      if (nodes.pieces[node] == points.pieces[rows[k]]) pairs.emplace_back(static_cast<Index>(k), node);
  const std::vector<bool> seen =
      sight_->see(eyes_of(rows_of(points.points, rows), rows_of(points.normals, rows)),
                  eyes_of(nodes.points, nodes.normals), pairs);
  std::vector<double> least(rows.size(), std::numeric_limits<double>::infinity());
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const auto [k, node] = pairs[p];
    const Index i = rows[k];
    const double cost = (points.points.row(i) - nodes.points.row(node)).squaredNorm() +
                        spacing * spacing * (points.normals.row(i) - nodes.normals.row(node)).squaredNorm();
    if (seen[p] && cost < least[k]) least[k] = cost, result[i] = node;
  }
  return result;
}

void RigShape::set_movers() {
  std::vector<std::vector<Index>> owned(surface.count(), std::vector<Index>(skeleton.count(), 0));
  std::vector<Index> all_owned(skeleton.count(), 0);
  for (Index i = 0; i < size(); ++i) {
    ++owned[nodes.pieces[i]][owners[i]];
    ++all_owned[owners[i]];
  }
  for (std::size_t piece = 0; piece < owned.size(); ++piece) {
    moves_.emplace_back();
    for (Index b = 0; b < skeleton.count(); ++b)
      moves_.back().push_back(static_cast<double>(owned[piece][b]) >
                              owning_share *
                                  static_cast<double>(std::min(node_counts_[piece], all_owned[b])));
  }
}

void RigShape::set_trust() {
  trust.resize(size());
  const double far = trusted_spacings * spacing;
  parallel_for(0, size(), 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      double square = far * far;
      for (const Index j : places_.within(nodes.points.row(i), far))
        if (nodes.pieces[i] != nodes.pieces[j] && !tree.matters(owners[i], owners[j], 0.0))
          square = std::min(square, (nodes.points.row(i) - nodes.points.row(j)).squaredNorm());
      trust[i] = std::max(least_trust, std::pow(square / (far * far), 2));
    }
  });
  const auto doubtful = static_cast<double>((trust.array() < doubtful_trust).count());
  cuts_itself_ = doubtful > doubtful_nodes * static_cast<double>(size());
  if (!cuts_itself_) trust.setOnes();
  std::vector<Index> in_doubt(node_counts_.size(), 0);
  for (Index i = 0; i < size(); ++i)
    if (trust[i] < doubtful_trust) ++in_doubt[nodes.pieces[i]];
  key_trust = trust;
  for (Index i = 0; i < size(); ++i) {
    const Index piece = nodes.pieces[i];
    if (static_cast<double>(in_doubt[piece]) > doubtful_surface * static_cast<double>(node_counts_[piece]))
      key_trust[i] = 0.0;
  }
}

std::vector<Index> RigShape::nodes_within(const Vec3& place, double distance, Index piece) const {
  std::vector<Index> result = places_.within(place, distance);
  std::erase_if(result, [&](Index node) { return nodes.pieces[node] != piece && stands_alone(piece); });
  std::ranges::sort(result);
  return result;
}

Index RigShape::holder(const Vec3& point, Index node) const {
  const Index b = owners[node];
  const double t = skeleton.along(b, point);
  if (t < hold_from) return -1;
  if (t <= hold_to || skeleton.is_leaf(b)) return b;
  for (Index other = 0; other < skeleton.count(); ++other)
    if (skeleton.bone(other).parent == b && bone_distances(node, b) > clearly * bone_distances(node, other))
      return -1;
  return b;
}

void RigShape::set_handles() {
  const Points& points = surface.points;
  std::vector<std::vector<Index>> held(skeleton.count());
  for (Index i = 0; i < points.rows(); ++i)
    if (const Index b = holder(points.row(i), sample_nodes[i]); b >= 0) held[b].push_back(i);
  for (Index b = 0; b < skeleton.count(); ++b) {
    const Bone& bone = skeleton.bone(b);
    const auto distance_of = [&](Index i) {
      const Vec3 point = points.row(i);
      return (skeleton.nearest(b, point) - point).norm();
    };
    std::vector<Index> all(points.rows());
    std::iota(all.begin(), all.end(), Index{0});
    const Index count = std::min<Index>(least_held, points.rows());
    std::ranges::partial_sort(all, all.begin() + count, {}, distance_of);
    const std::string name =
        bone.name.empty() ? "bones[" + std::to_string(skeleton.original(b)) + "]" : "bone " + bone.name;
    require(distance_of(all.front()) < farthest * extent, name, "it lies far outside of the shape",
            "move it into the shape, or make it a helper");
    if (static_cast<Index>(held[b].size()) < least_held) {
      held[b].assign(all.begin(), all.begin() + count);
      std::ranges::sort(held[b]);
    }
    Handle handle;
    handle.kind = Handle::Kind::region;
    handle.rest = bone_box(bone);
    handle.target = handle.rest;
    handle.samples = std::move(held[b]);
    handles.push_back(std::move(handle));
  }
}

RigShape rig_shape(const TriangleMesh& mesh, const WeldedVertices& welded, const VertexWeights& painted,
                   const std::vector<Bone>& bones, const SkinOptions& options, const Progress& progress) {
  const SurfaceSamples samples =
      sample_mesh(mesh.vertices, mesh.triangles, options.samples, options.seed, painted);
  const std::vector<Index> piece_of = welded.pieces(mesh);
  const SignedDistance soup(mesh.vertices, mesh.triangles, progress);
  std::vector<Index> pieces;
  for (const std::int32_t t : soup.closest(samples.frame.to_mesh(samples.points), progress).triangles)
    pieces.push_back(piece_of[mesh.triangles(t, 0)]);
  std::vector<Index> sizes(welded.first.size(), 0);
  for (const Index piece : pieces) ++sizes[piece];
  const auto is_small = [&](Index piece) { return sizes[piece] < BoneSight::all_sides; };
  if (2 * std::ranges::count_if(pieces, is_small) > samples.size()) pieces.clear();  // a triangle soup
  return RigShape(samples, bones, progress, std::move(pieces));
}

std::vector<Handle> bone_handles(const SurfaceSamples& samples, const std::vector<Bone>& bones) {
  RigShape rig(samples, bones, {});
  std::vector<Index> place(bones.size(), -1);
  for (Index b = 0; b < rig.skeleton.count(); ++b) place[rig.skeleton.original(b)] = b;
  for (const auto& [bone, at] : coincident_bones(bones)) place[bone] = place[at];
  std::vector<Handle> result;
  for (std::size_t i = 0; i < bones.size(); ++i) {
    if (place[i] < 0) continue;
    result.push_back(rig.handles[place[i]]);
    result.back().rest = bone_box(bones[i]);
    result.back().target = result.back().rest;
  }
  return result;
}

}  // namespace arapfields
