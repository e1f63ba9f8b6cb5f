// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/fine_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "core/parallel.h"
#include "core/smoothstep.h"
#include "distance/signed_distance.h"

namespace arapfields {
namespace {

/// Where the shape's thickness about a bone is measured, as shares of its length.
constexpr std::array<double, 5> measured_at{0.1, 0.3, 0.5, 0.7, 0.9};
/// A bone is thin where the shape about it has at most this radius, and two thin bones lie beside each other
/// where between the outer halves of both there is at most this gap, in spacings of the nodes.
constexpr double thin_radius = 1.0, beside_gap = 1.0;
/// A part is as large as the box of its thin bones, at most this share of the shape; it holds what is nearer
/// to them than its size, and its own weights count fully up to the first of these shares of it, and nothing
/// from the second one.
constexpr double largest_part = 0.5, full_share = 0.25, no_share = 0.75;

/// Half of the thickness of the shape about the middle of each bone; infinite for bones that lie outside.
std::vector<double> radii_of(const Skeleton& skeleton, const SignedDistance& surface, double extent) {
  const Index count = skeleton.count(), each = std::ssize(measured_at);
  Points places(count * each, 3);
  for (Index b = 0; b < count; ++b)
    for (Index k = 0; k < each; ++k)
      places.row(b * each + k) =
          ((1.0 - measured_at[k]) * skeleton.bone(b).head + measured_at[k] * skeleton.bone(b).tail)
              .transpose();
  Vector distances(places.rows());
  const Points nearest = surface.evaluate_closest(places, distances).points;
  Points ends = places;
  for (Index i = 0; i < places.rows(); ++i)
    ends.row(i) += 2.0 * extent * (places.row(i) - nearest.row(i)).stableNormalized();
  const Vector across = surface.first_crossings(places, ends);
  std::vector<double> result;
  for (Index b = 0; b < count; ++b) {
    std::vector<double> inside;
    for (Index i = b * each; i < (b + 1) * each; ++i)
      if (distances[i] < 0.0)
        inside.push_back(0.5 * (std::min(across[i], 1.0) * 2.0 * extent - distances[i]));
    std::ranges::sort(inside);
    result.push_back(inside.empty() ? std::numeric_limits<double>::infinity() : inside[inside.size() / 2]);
  }
  return result;
}

/// The distance of a point from a bone. The rig's own parts of it may end before the tail, where the nodes of
/// the whole are too far apart to enclose it.
double distance_to(const Bone& bone, const Vec3& point) {
  return (closest_on({bone.head, bone.tail}, point).first - point).norm();
}

/// The distance between the outer halves of two bones.
double outer_distance(const Bone& first, const Bone& second) {
  const Vec3 a = 0.5 * (first.head + first.tail), b = 0.5 * (second.head + second.tail);
  const Vec3 along = first.tail - a, other = second.tail - b, between = a - b;
  const double aa = along.squaredNorm(), bb = other.squaredNorm(), ab = along.dot(other);
  const double da = along.dot(between), db = other.dot(between), det = aa * bb - ab * ab;
  double s = det > 1e-12 * aa * bb ? std::clamp((ab * db - bb * da) / det, 0.0, 1.0) : 0.5;
  const double t = std::clamp((ab * s + db) / bb, 0.0, 1.0);
  s = std::clamp((ab * t - da) / aa, 0.0, 1.0);
  return (between + s * along - t * other).norm();
}

/// A bone and its ancestors, from itself up.
std::vector<Index> line_of(const Skeleton& skeleton, Index b) {
  std::vector<Index> result;
  for (; b >= 0; b = skeleton.bone(b).parent) result.push_back(b);
  return result;
}

bool descends(const Skeleton& skeleton, Index b, Index from) {
  while (b >= 0 && b != from) b = skeleton.bone(b).parent;
  return b >= 0;
}

/// The bones on which parts hang: of each set of thin bones beside each other the last one that they have in
/// common, with the set.
std::vector<std::pair<Index, std::vector<Index>>> groups_of(const RigShape& rig,
                                                            const SignedDistance& surface) {
  const Skeleton& skeleton = rig.skeleton;
  const std::vector<double> radii = radii_of(skeleton, surface, rig.extent);
  std::vector<Index> group(skeleton.count());
  std::iota(group.begin(), group.end(), Index{0});
  for (Index a = 0; a < skeleton.count(); ++a)
    for (Index b = 0; b < a; ++b) {
      if (std::max(radii[a], radii[b]) > thin_radius * rig.spacing || !rig.pulls[a] || !rig.pulls[b])
        continue;
      if (descends(skeleton, a, b) || descends(skeleton, b, a)) continue;
      if (outer_distance(skeleton.bone(a), skeleton.bone(b)) < radii[a] + radii[b] + beside_gap * rig.spacing)
        std::ranges::replace(group, Index{group[a]}, Index{group[b]});
    }
  std::vector<std::pair<Index, std::vector<Index>>> result;
  for (Index g = 0; g < skeleton.count(); ++g) {
    std::vector<Index> bones;
    for (Index b = 0; b < skeleton.count(); ++b)
      if (group[b] == g) bones.push_back(b);
    if (bones.size() < 2) continue;
    for (const Index common : line_of(skeleton, bones.front()))
      if (std::ranges::all_of(bones, [&](Index b) { return descends(skeleton, b, common); })) {
        result.emplace_back(common, std::move(bones));
        break;
      }
  }
  return result;
}

/// The bones of a part, as a skeleton, without those that are farther than `reach` from all vertices.
void set_bones(const Skeleton& skeleton, Index hangs_on, const Points& vertices, double reach,
               FinePart& part) {
  std::vector<Index> place(skeleton.count(), -1);
  for (Index b = 0; b < skeleton.count(); ++b) {
    const bool is_near = std::ranges::any_of(
        part.vertices, [&](Index v) { return distance_to(skeleton.bone(b), vertices.row(v)) < reach; });
    if (!is_near || !(b == skeleton.bone(hangs_on).parent || descends(skeleton, b, hangs_on))) continue;
    place[b] = std::ssize(part.bones);
    part.bones.push_back(skeleton.bone(b));
    part.columns.push_back(b);
  }
  for (Bone& bone : part.bones) {
    while (bone.parent >= 0 && place[bone.parent] < 0) bone.parent = skeleton.bone(bone.parent).parent;
    if (bone.parent >= 0) bone.parent = place[bone.parent];
  }
}

std::optional<FinePart> part_of(const RigShape& rig, Index hangs_on, const std::vector<Index>& thin,
                                double size, const TriangleMesh& mesh, const WeldedVertices& welded,
                                const std::vector<Index>& pieces) {
  const Skeleton& skeleton = rig.skeleton;
  Vector away(mesh.vertices.rows());
  parallel_for(0, away.size(), 256, [&](Index first, Index last) {
    for (Index v = first; v < last; ++v) {
      away[v] = std::numeric_limits<double>::infinity();
      for (const Index b : thin)
        away[v] = std::min(away[v], distance_to(skeleton.bone(b), mesh.vertices.row(v)));
    }
  });
  std::vector<Index> near;
  for (Index v = 0; v < away.size(); ++v)
    if (away[v] < size) near.push_back(v);
  if (near.empty()) return std::nullopt;
  PiecePoints points{mesh.vertices(near, Eigen::all), welded.normals(near, Eigen::all), {}};
  for (const Index v : near) points.pieces.push_back(pieces[v]);
  const std::vector<Index> nodes = rig.nearest_nodes(points);
  std::vector<std::int32_t> place(away.size(), -1);
  FinePart part;
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Index owner = rig.owners[nodes[k]];
    if (owner != skeleton.bone(hangs_on).parent && !descends(skeleton, owner, hangs_on)) continue;
    place[near[k]] = static_cast<std::int32_t>(part.vertices.size());
    part.vertices.push_back(near[k]);
  }
  std::vector<std::int32_t> corners;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return place[mesh.triangles(t, k)]; };
    if (corner(0) >= 0 && corner(1) >= 0 && corner(2) >= 0)
      corners.insert(corners.end(), {corner(0), corner(1), corner(2)});
  }
  if (corners.empty()) return std::nullopt;
  part.mesh.vertices = mesh.vertices(part.vertices, Eigen::all);
  part.mesh.triangles = Eigen::Map<const Triangles>(corners.data(), std::ssize(corners) / 3, 3);
  part.shares = away(part.vertices);
  for (double& share : part.shares) share = smoothstep(no_share, full_share, share / size);
  set_bones(skeleton, hangs_on, mesh.vertices, 0.5 * size, part);
  return part;
}

}  // namespace

std::vector<FinePart> fine_parts(const RigShape& rig, const TriangleMesh& mesh,
                                 const WeldedVertices& welded) {
  std::vector<std::pair<double, FinePart>> found;
  std::vector<Index> pieces;
  for (const auto& [hangs_on, thin] : groups_of(rig, SignedDistance(mesh.vertices, mesh.triangles))) {
    Points ends(2 * std::ssize(thin), 3);
    for (std::size_t k = 0; k < thin.size(); ++k) {
      ends.row(2 * k) = rig.skeleton.bone(thin[k]).head.transpose();
      ends.row(2 * k + 1) = rig.skeleton.bone(thin[k]).tail.transpose();
    }
    const double size = diagonal_of(ends);
    if (size > largest_part * rig.extent) continue;
    if (pieces.empty()) pieces = welded.pieces(mesh);
    if (std::optional<FinePart> part = part_of(rig, hangs_on, thin, size, mesh, welded, pieces))
      found.emplace_back(size, std::move(*part));
  }
  std::ranges::stable_sort(found, std::ranges::greater(), [](const auto& each) { return each.first; });
  std::vector<FinePart> result;
  for (auto& [size, part] : found) result.push_back(std::move(part));
  return result;
}

}  // namespace arapfields
