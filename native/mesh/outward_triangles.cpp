// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh/outward_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "mesh/edge_passages.h"

namespace arapfields {
namespace {

/// A patch is a sheet if the square of its boundary's length is more times its area: 12.6 for a disc, the
/// least of all flat sheets. Others are bodies with or without holes: 6.3 for half a sphere, 8.2 for a cap as
/// high as .7 of its radius.
constexpr double long_boundary = 9.0;
/// One below this ratio is closed but for small holes, and can have others inside: .5 for a sphere without a
/// cap of a fifth of its diameter.
constexpr double small_holes = 1.0;
/// A body that encloses less than this share of the 3/2 power of its area has no outside: a closed one that
/// is as flat as rounding; an open one that is hollow on both sides. .13 for half a sphere.
constexpr double flat = 1e-9, flat_with_holes = 5e-3;
/// Vertices of a patch that tell whether it lies inside another one.
constexpr std::size_t most_witnesses = 16;

/// Connected triangles, each with whether it faces the other way than the first one, by union-find.
class Patches {
 public:
  explicit Patches(Index count)
      : parent_(static_cast<std::size_t>(count)), turned_(static_cast<std::size_t>(count)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  /// The representative of a triangle's patch, and whether the triangle faces the other way than it.
  std::pair<std::int32_t, bool> find(std::int32_t t) {
    std::int32_t root = t;
    bool turned = false;
    for (; parent_[root] != root; root = parent_[root]) turned ^= turned_[root] != 0;
    for (bool left = turned; parent_[t] != root && t != root;) {
      const std::int32_t next = parent_[t];
      const bool own = turned_[t] != 0;
      parent_[t] = root;
      turned_[t] = left ? 1 : 0;
      left ^= own;
      t = next;
    }
    return {root, turned};
  }
  /// Joins the patches of two triangles; `against`: they face opposite sides. Where they are joined already,
  /// as around a Möbius strip, nothing changes.
  void join(std::int32_t a, std::int32_t b, bool against) {
    const auto [first, first_turned] = find(a);
    const auto [second, second_turned] = find(b);
    if (first == second) return;
    const std::int32_t low = std::min(first, second), high = std::max(first, second);
    parent_[high] = low;
    turned_[high] = (first_turned ^ second_turned ^ against) ? 1 : 0;
  }

 private:
  std::vector<std::int32_t> parent_;
  std::vector<char> turned_;  // against the parent
};

struct Patch {
  std::vector<std::int32_t> triangles;
  double area = 0.0, turned_area = 0.0;
  double boundary = 0.0;             ///< length
  Vec3 boundary_sum = Vec3::Zero();  ///< of the boundary's edges' middles, by length
  double volume = 0.0;               ///< with the orientation of most of it; 0: no body
  Eigen::AlignedBox3d box;
  bool turns = false;
  double boundary_share() const { return boundary * boundary / area; }  ///< 0 where it is closed
};

/// Whether a ray from the point along x meets the triangles an odd number of times.
bool encloses(const TriangleMesh& mesh, const Patch& patch, const Vec3& point) {
  bool inside = false;
  for (const std::int32_t t : patch.triangles) {
    const auto corner = [&](int k) { return Vec3(mesh.vertices.row(mesh.triangles(t, k))); };
    const Vec3 corners[3] = {corner(0), corner(1), corner(2)};
    bool within = false;  // of the triangle's projection along x; edges belong to one of two neighbours
    for (int k = 0; k < 3; ++k) {
      const Vec3 &a = corners[k], &b = corners[(k + 1) % 3];
      if ((a[2] > point[2]) == (b[2] > point[2])) continue;
      const Vec3 &low = a[2] < b[2] ? a : b, &high = a[2] < b[2] ? b : a;
      within ^= point[1] < low[1] + (point[2] - low[2]) / (high[2] - low[2]) * (high[1] - low[1]);
    }
    if (!within) continue;
    const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (normal[0] == 0.0) continue;
    const double x =
        corners[0][0] -
        (normal[1] * (point[1] - corners[0][1]) + normal[2] * (point[2] - corners[0][2])) / normal[0];
    inside ^= x > point[0];
  }
  return inside;
}

/// Decides which patches turn, by their volumes and by which of them lie inside others.
void decide(const TriangleMesh& mesh, std::vector<Patch>& patches) {
  std::vector<std::size_t> bodies;
  bool any = false;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (patches[i].volume != 0.0) bodies.push_back(i);
    any = any || patches[i].volume < 0.0;
  }
  if (!any) return;
  std::stable_sort(bodies.begin(), bodies.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(patches[a].volume) > std::abs(patches[b].volume);
  });
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    Patch& patch = patches[bodies[k]];
    patch.turns = patch.volume < 0.0;
    // The smallest patch around it is the last one in the order of volumes.
    for (std::size_t l = k; l-- > 0;) {
      const Patch& around = patches[bodies[l]];
      if (!(around.boundary_share() < small_holes) || !around.box.contains(patch.box)) continue;
      bool inside = true;
      const std::size_t step = std::max<std::size_t>(patch.triangles.size() / most_witnesses, 1);
      for (std::size_t i = 0; i < patch.triangles.size() && inside; i += step)
        inside = encloses(mesh, around, mesh.vertices.row(mesh.triangles(patch.triangles[i], 0)));
      if (!inside) continue;
      patch.turns = around.turns;
      break;
    }
  }
}

}  // namespace

Triangles outward_triangles(const TriangleMesh& mesh, Vector* sheet_sizes) {
  validate(mesh);
  const Index count = mesh.triangles.rows();
  Patches joined(count);
  std::vector<std::pair<std::int32_t, std::pair<std::int32_t, std::int32_t>>> boundary;  // triangle, edge
  EdgePassages(mesh.vertices, mesh.triangles).each_edge([&](std::int32_t low, auto from, auto to) {
    if (to - from == 2)
      joined.join(from[0].triangle, from[1].triangle, from[0].upwards == from[1].upwards);
    else if ((to - from) % 2 == 1)
      for (auto p = from; p != to; ++p) boundary.push_back({p->triangle, {low, p->high}});
  });

  std::vector<Patch> patches;
  std::vector<std::int32_t> number(static_cast<std::size_t>(count), -1);  // of a representative's patch
  std::vector<std::int32_t> patch_of(static_cast<std::size_t>(count));
  std::vector<bool> turned(static_cast<std::size_t>(count));
  const auto corner = [&](Index t, int k) { return Vec3(mesh.vertices.row(mesh.triangles(t, k))); };
  each_in_order(count, [&](Index row) {
    const auto t = static_cast<std::int32_t>(row);
    const auto [root, against] = joined.find(t);
    if (number[root] < 0) {
      number[root] = static_cast<std::int32_t>(patches.size());
      patches.emplace_back();
    }
    patch_of[t] = number[root];
    turned[t] = against;
    Patch& patch = patches[static_cast<std::size_t>(patch_of[t])];
    const double area = 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    patch.triangles.push_back(t);
    patch.area += area;
    if (against) patch.turned_area += area;
    for (int k = 0; k < 3; ++k) patch.box.extend(corner(t, k));
  });
  for (const auto& [triangle, edge] : boundary) {
    Patch& patch = patches[static_cast<std::size_t>(patch_of[triangle])];
    const Vec3 a = mesh.vertices.row(edge.first), b = mesh.vertices.row(edge.second);
    patch.boundary += (b - a).norm();
    patch.boundary_sum += (b - a).norm() * 0.5 * (a + b);
  }
  for (Patch& patch : patches) {
    const bool most_turned = patch.turned_area > 0.5 * patch.area;
    for (const std::int32_t t : patch.triangles) turned[t] = turned[t] != most_turned;
    if (!(patch.boundary_share() < long_boundary)) continue;
    // Holes are closed by triangles to the middle of the boundary.
    const Vec3 origin =
        patch.boundary > 0.0 ? Vec3(patch.boundary_sum / patch.boundary) : corner(patch.triangles.front(), 0);
    for (const std::int32_t t : patch.triangles) {
      const double part = (corner(t, 0) - origin).dot((corner(t, 1) - origin).cross(corner(t, 2) - origin));
      patch.volume += (turned[t] ? -part : part) / 6.0;
    }
    const double least = patch.boundary > 0.0 ? flat_with_holes : flat;
    if (std::abs(patch.volume) < least * std::pow(patch.area, 1.5)) patch.volume = 0.0;
  }
  decide(mesh, patches);
  if (sheet_sizes != nullptr) {
    sheet_sizes->setZero(count);
    for (const Patch& patch : patches)
      if (!(patch.boundary_share() < long_boundary))
        for (const std::int32_t t : patch.triangles) (*sheet_sizes)[t] = std::sqrt(patch.area);
  }

  Triangles result = mesh.triangles;
  for (std::int32_t t = 0; t < count; ++t)
    if (turned[t] != patches[static_cast<std::size_t>(patch_of[t])].turns)
      std::swap(result(t, 1), result(t, 2));
  return result;
}

TriangleMesh facing_outwards(const TriangleMesh& mesh) { return {mesh.vertices, outward_triangles(mesh)}; }

}  // namespace arapfields
