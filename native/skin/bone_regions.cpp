// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_regions.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/errors.h"
#include "core/parallel.h"
#include "sampling/nearest_sample.h"

namespace arapfields {
namespace {

/// How much farther a bone straight outside of the surface counts than one inside.
constexpr double outside = 3.0;
/// What of a bone's length holds samples, and how many it holds at least.
constexpr double hold_from = 0.3, hold_to = 0.7;
constexpr Index least_held = 12;
/// In sizes of the shape, how far a bone may lie from it.
constexpr double farthest = 0.5;
constexpr float infinity = std::numeric_limits<float>::infinity();

}  // namespace

BoneRegions::BoneRegions(const Skeleton& skeleton, PointsIn points, PointsIn normals)
    : distances(points.rows(), skeleton.count()), owner(points.rows()) {
  parallel_for(0, points.rows(), 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const Vec3 point = points.row(i), normal = normals.row(i);
      double least = std::numeric_limits<double>::infinity();
      for (Index b = 0; b < skeleton.count(); ++b) {
        const Vec3 to = skeleton.nearest(b, point) - point;
        const double distance = to.norm();
        const double cosine = distance > 0.0 ? to.dot(normal) / distance : 0.0;
        const double cost = distance * (1.0 + outside * std::max(0.0, cosine));
        distances(i, b) = static_cast<float>(distance);
        if (cost < least) least = cost, owner[i] = b;
      }
    }
  });
}

std::vector<Handle> bone_handles(const SurfaceSamples& samples, const Skeleton& skeleton) {
  const Points points = samples.frame.to_mesh(samples.points);
  const BoneRegions regions(skeleton, points, samples.normals);
  const double size = body_size(points);
  std::vector<std::vector<Index>> held(skeleton.count());
  for (Index i = 0; i < points.rows(); ++i) {
    const Index b = regions.owner[i];
    const double t = skeleton.along(b, points.row(i).transpose());
    if (t >= hold_from && (t <= hold_to || skeleton.is_leaf(b))) held[b].push_back(i);
  }
  std::vector<Handle> handles;
  for (Index b = 0; b < skeleton.count(); ++b) {
    const Bone& bone = skeleton.bone(b);
    const auto column = regions.distances.col(b);
    const std::string name =
        bone.name.empty() ? "bones[" + std::to_string(skeleton.original(b)) + "]" : "bone " + bone.name;
    require(static_cast<double>(column.minCoeff()) < farthest * size, name,
            "it lies far outside of the shape", "move it into the shape, or make it a helper");
    if (static_cast<Index>(held[b].size()) < least_held) {
      const Index count = std::min<Index>(least_held, points.rows());
      std::vector<Index> all(points.rows());
      std::iota(all.begin(), all.end(), Index{0});
      std::ranges::partial_sort(all, all.begin() + count, {}, [&](Index i) { return column[i]; });
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
  return handles;
}

std::vector<Handle> bone_handles(const SurfaceSamples& samples, const std::vector<Bone>& bones) {
  return bone_handles(samples, Skeleton(bones));
}

RowMatrix<float> interior_bone_distances(const InteriorGraph& graph, const BoneRegions& regions) {
  RowMatrix<float> result(regions.distances.rows(), regions.distances.cols());
  parallel_jobs(result.cols(), [&](Index b) {
    std::vector<float> start(result.rows(), infinity);
    for (Index i = 0; i < result.rows(); ++i)
      if (regions.owner[i] == b) start[i] = regions.distances(i, b);
    if (std::ranges::find(regions.owner, b) == regions.owner.end()) {  // it lies in others' parts
      Index nearest = 0;
      const float least = regions.distances.col(b).minCoeff(&nearest);
      start[nearest] = least;
    }
    const std::vector<float> lengths = graph.distances_from(std::move(start));
    for (Index i = 0; i < result.rows(); ++i) result(i, b) = lengths[i];
  });
  return result;
}

}  // namespace arapfields
