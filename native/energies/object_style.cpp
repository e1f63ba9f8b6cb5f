// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/object_style.h"

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/errors.h"
#include "distance/hierarchy.h"
#include "energies/gauss.h"
#include "energies/ranges.h"
#include "mesh/is_closed.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {
namespace {

/// Cosine of 30°, the largest dihedral deviation across which normals are smoothed.
constexpr double crease = 0.8660254037844387;
/// Volume over area^1.5 below which a shape counts as flat; a ball has 0.094, a card of 1 : 1 : 0.001 3e-4.
constexpr double flattest = 1e-5;
/// Tolerance of barycentric coordinates in ray intersection, so that no ray passes between two triangles.
constexpr double slack = 1e-9;
/// Rings of directions around the given one, ring k with 6 k of them, over which T is averaged.
constexpr int rings = 2;

using Corners = std::array<Vec3, 3>;

Vec3 unit_or_zero(const Vec3& vector) {
  const double length = vector.stableNorm();
  return length > 0.0 ? Vec3(vector / length) : Vec3(Vec3::Zero());
}

/// Normals at the corners of triangles. Triangles around a vertex that are connected by smooth edges share
/// one, with weights that make it exact for vertices on a sphere (Max 1999, "Weights for Computing Vertex
/// Normals from Facet Normals").
std::vector<Corners> corner_normals(const Points& vertices, const Triangles& triangles) {
  const Index count = triangles.rows();
  std::vector<Vec3> flat(count);
  std::vector<std::vector<std::int32_t>> around(vertices.rows());
  const auto corner = [&](Index t, int k) -> Vec3 { return vertices.row(triangles(t, k % 3)).transpose(); };
  for (Index t = 0; t < count; ++t) {
    flat[t] = unit_or_zero((corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)));
    for (int k = 0; k < 3; ++k) around[triangles(t, k)].push_back(static_cast<std::int32_t>(3 * t + k));
  }
  std::vector<Corners> result(count);
  std::vector<std::int32_t> group, open;
  for (const std::vector<std::int32_t>& fan : around) {
    std::vector<bool> taken(fan.size(), false);
    for (std::size_t first = 0; first < fan.size(); ++first) {
      if (taken[first]) continue;
      taken[first] = true;
      group.clear();
      Vec3 sum = Vec3::Zero();
      for (open = {static_cast<std::int32_t>(first)}; !open.empty();) {
        const std::int32_t at = fan[open.back()];
        open.pop_back();
        group.push_back(at);
        const Index t = at / 3;
        const int k = at % 3;
        const Vec3 a = corner(t, k + 1) - corner(t, k), b = corner(t, k + 2) - corner(t, k);
        const double weight = a.squaredNorm() * b.squaredNorm();
        if (weight > 0.0) sum += a.cross(b) / weight;
        for (std::size_t other = 0; other < fan.size(); ++other) {
          const Index u = fan[other] / 3;
          const int l = fan[other] % 3;
          const bool meet = triangles(t, (k + 1) % 3) == triangles(u, (l + 2) % 3) ||
                            triangles(t, (k + 2) % 3) == triangles(u, (l + 1) % 3);
          if (taken[other] || !meet || flat[t].dot(flat[u]) < crease) continue;
          taken[other] = true;
          open.push_back(static_cast<std::int32_t>(other));
        }
      }
      for (const std::int32_t at : group) result[at / 3][at % 3] = unit_or_zero(sum);
    }
  }
  return result;
}

}  // namespace

struct ObjectStyle::Surface {
  Surface(PointsIn given, TrianglesIn faces, const Progress& progress)
      : mesh{given, faces},
        vertices(given),
        triangles(welded(given, faces)),
        hierarchy(vertices, triangles, progress) {
    double volume = 0.0, area = 0.0;
    Vec3 moment = Vec3::Zero();
    for (Index i = 0; i < vertices.rows(); ++i)
      vertices.row(i) = hierarchy.normalized(vertices.row(i).transpose()).transpose();
    for (Index t = 0; t < triangles.rows(); ++t) {
      const Corners c = corners(t);
      const double six = c[0].dot(c[1].cross(c[2]));
      volume += six / 6.0;
      moment += six / 24.0 * (c[0] + c[1] + c[2]);
      area += 0.5 * (c[1] - c[0]).cross(c[2] - c[0]).norm();
    }
    require(std::abs(volume) > flattest * std::pow(area, 1.5), "triangles",
            "they enclose next to no volume: the style object is flat",
            "a closed surface around a solid is needed");
    centroid = moment / volume;
    normals = corner_normals(vertices, triangles);
    if (volume < 0.0)
      for (Corners& corner : normals)
        for (Vec3& normal : corner) normal = -normal;
  }

  /// The triangles with vertices welded by position; throws if they are not closed.
  static Triangles welded(PointsIn vertices, TrianglesIn triangles) {
    validate(vertices, triangles);
    require(is_closed(vertices, triangles), "triangles", "they do not close: the style object is open",
            "a closed surface around a solid is needed");
    const std::vector<std::int32_t> first = first_at_position(vertices);
    Triangles result = triangles;
    for (Index t = 0; t < result.rows(); ++t)
      for (int k = 0; k < 3; ++k) result(t, k) = first[result(t, k)];
    return result;
  }

  Corners corners(Index t) const {
    return {vertices.row(triangles(t, 0)).transpose(), vertices.row(triangles(t, 1)).transpose(),
            vertices.row(triangles(t, 2)).transpose()};
  }

  /// The last intersection of a ray: its distance, triangle, and barycentric coordinates.
  struct Exit {
    double distance = 0.0;
    Index triangle = -1;
    Vec3 shares = Vec3::Zero();
  };

  void meet(Index t, const Vec3& direction, Exit& exit) const {  // Möller and Trumbore 1997
    const Corners c = corners(t);
    const Vec3 a = c[1] - c[0], b = c[2] - c[0], p = direction.cross(b), from = centroid - c[0];
    const double determinant = a.dot(p);
    if (determinant == 0.0) return;
    const double u = from.dot(p) / determinant;
    const Vec3 q = from.cross(a);
    const double v = direction.dot(q) / determinant, distance = b.dot(q) / determinant;
    if (u < -slack || v < -slack || u + v > 1.0 + slack || !(distance > exit.distance)) return;
    exit = {distance, t, Vec3(1.0 - u - v, u, v)};
  }

  Exit last_exit(const Vec3& direction) const {
    Exit exit;
    const HierarchyView tree = hierarchy.view();
    const Vec3 slope = direction.unaryExpr([](double x) { return 1.0 / (std::abs(x) < 1e-30 ? 1e-30 : x); });
    std::int32_t stack[stack_size];
    int height = 0;
    stack[height++] = 0;
    while (height > 0) {
      const WideNode& node = tree.nodes[stack[--height]];
      for (int lane = 0; lane < node.count; ++lane) {
        double near = 0.0, far = INFINITY;
        for (int k = 0; k < 3; ++k) {
          const double low = (node.low[k][lane] - centroid[k]) * slope[k];
          const double high = (node.high[k][lane] - centroid[k]) * slope[k];
          near = std::max(near, std::min(low, high));
          far = std::min(far, std::max(low, high));
        }
        if (near > far * (1.0 + slack) || far * (1.0 + slack) < exit.distance) continue;
        if (node.child[lane] >= 0) {
          stack[height++] = node.child[lane];
          continue;
        }
        const TrianglePacket& packet = tree.packets[~node.child[lane]];
        for (const std::int32_t t : packet.triangle) meet(t, direction, exit);
      }
    }
    return exit;
  }

  TriangleMesh mesh;  // as it was given
  Points vertices;
  Triangles triangles;
  Hierarchy hierarchy;
  Vec3 centroid;  // in the hierarchy's coordinates, as the vertices
  std::vector<Corners> normals;
};

ObjectStyle::ObjectStyle(PointsIn vertices, TrianglesIn triangles, const Progress& progress)
    : surface_(std::make_shared<Surface>(vertices, triangles, progress)) {}

ObjectStyle ObjectStyle::turned(const Mat3& turn) const {
  ObjectStyle result = *this;
  result.turn_ = turn * turn_;
  return result;
}

const TriangleMesh& ObjectStyle::mesh() const { return surface_->mesh; }

Vec3 ObjectStyle::centroid() const { return surface_->hierarchy.restored(surface_->centroid); }

Vec3 ObjectStyle::normal(const Vec3& direction) const {
  const Surface::Exit exit = surface_->last_exit(direction);
  if (exit.triangle < 0) return direction;
  const Corners& corners = surface_->normals[exit.triangle];
  const Vec3 normal =
      unit_or_zero(exit.shares[0] * corners[0] + exit.shares[1] * corners[1] + exit.shares[2] * corners[2]);
  return normal.squaredNorm() > 0.0 ? normal : direction;
}

Points ObjectStyle::normals(PointsIn given, double smoothing) const {
  require(smoothing >= 0.0 && smoothing <= 0.5 * std::numbers::pi, "smoothing", std::to_string(smoothing),
          "0 to a right angle, in radians, is allowed");
  if (given.rows() == 0) return Points(0, 3);
  const Points directions = unit_normals(given);
  Points result(directions.rows(), 3);
  for_ranges(directions.rows(), [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 middle = turn_.transpose() * directions.row(i).transpose();
      const Vec3 side = middle.unitOrthogonal(), other = middle.cross(side);
      Vec3 sum = normal(middle);
      // Evenly spaced directions on rings: their sum is along the central one, so that T = id is preserved.
      for (int ring = 1; smoothing > 0.0 && ring <= rings; ++ring) {
        const double angle = smoothing * ring / rings, share = static_cast<double>(ring) / rings;
        const double weight = std::exp(-2.0 * share * share);
        for (int k = 0; k < 6 * ring; ++k) {
          const double turn = 2.0 * std::numbers::pi * k / (6 * ring);
          sum += weight * normal(std::cos(angle) * middle +
                                 std::sin(angle) * (std::cos(turn) * side + std::sin(turn) * other));
        }
      }
      const Vec3 mean = unit_or_zero(sum);
      result.row(i) = (turn_ * (mean.squaredNorm() > 0.0 ? mean : middle)).transpose();
    }
  });
  return result;
}

}  // namespace arapfields
