// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes for the native tests.
#pragma once

#include <cmath>
#include <numbers>

#include "core/random.h"
#include "mesh/triangle_mesh.h"

namespace arapfields::shapes {

/// A closed torus about z, rings × sides quads.
inline TriangleMesh torus(int rings, int sides, double major = 1.0, double minor = 0.4) {
  TriangleMesh mesh{Points(rings * sides, 3), Triangles(2 * rings * sides, 3)};
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sides; ++j) {
      const double u = 2 * std::numbers::pi * i / rings, v = 2 * std::numbers::pi * j / sides;
      const double ring = major + minor * std::cos(v);
      const int at = i * sides + j, k = (i + 1) % rings, l = (j + 1) % sides;
      mesh.vertices.row(at) << ring * std::cos(u), ring * std::sin(u), minor * std::sin(v);
      mesh.triangles.row(2 * at) << at, k * sides + j, k * sides + l;
      mesh.triangles.row(2 * at + 1) << at, k * sides + l, i * sides + l;
    }
  return mesh;
}

/// A round bar along x, closed at its ends, with flat sides.
inline TriangleMesh bar(double length, double width, int cells) {
  constexpr int sides = 12;
  TriangleMesh mesh{Points((cells + 1) * sides, 3), Triangles(2 * cells * sides, 3)};
  for (int i = 0; i <= cells; ++i) {
    const double x = 2.0 * i / cells - 1.0, radius = width * (1.0 - std::pow(x, 12.0));
    for (int k = 0; k < sides; ++k) {
      const double turn = 2.0 * std::numbers::pi * k / sides;
      mesh.vertices.row(i * sides + k) << 0.5 * length * x, radius * std::cos(turn), radius * std::sin(turn);
    }
  }
  for (int i = 0; i < cells; ++i)
    for (int k = 0; k < sides; ++k) {
      const int a = i * sides + k, b = i * sides + (k + 1) % sides;
      mesh.triangles.row(2 * a) << a, b, b + sides;
      mesh.triangles.row(2 * a + 1) << a, b + sides, a + sides;
    }
  return mesh;
}

inline TriangleMesh box_mesh(const Vec3& half, const Vec3& center) {
  TriangleMesh mesh{Points(8, 3), Triangles(12, 3)};
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner((i & 1) ? 1 : -1, (i & 2) ? 1 : -1, (i & 4) ? 1 : -1);
    mesh.vertices.row(i) = (center + half.cwiseProduct(corner)).transpose();
  }
  mesh.triangles << 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2,
      1, 3, 7, 1, 7, 5;
  return mesh;
}

/// Triangles with corners anywhere in a cube; every fifth is a line, every seventh a point, every eleventh
/// its forerunner once more.
inline TriangleMesh soup(int count, std::uint64_t seed) {
  Random random(seed);
  TriangleMesh mesh{Points(3 * count, 3), Triangles(count, 3)};
  for (int t = 0; t < count; ++t) {
    const Vec3 center(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const double size = std::pow(10.0, random.uniform(-3, 0));
    for (int k = 0; k < 3; ++k)
      mesh.vertices.row(3 * t + k) = (center + size * random.direction()).transpose();
    if (t % 5 == 4)
      mesh.vertices.row(3 * t + 2) = 0.3 * mesh.vertices.row(3 * t) + 0.7 * mesh.vertices.row(3 * t + 1);
    if (t % 7 == 6) mesh.vertices.middleRows(3 * t + 1, 2) = mesh.vertices.row(3 * t).replicate(2, 1);
    if (t % 11 == 10) mesh.vertices.middleRows(3 * t, 3) = mesh.vertices.middleRows(3 * t - 3, 3);
    mesh.triangles.row(t) << 3 * t, 3 * t + 1, 3 * t + 2;
  }
  return mesh;
}

/// Queries of all kinds: in the cube, far away, at vertices and on triangles.
inline Points queries(const TriangleMesh& mesh, int count, std::uint64_t seed) {
  Random random(seed, 1);
  Points points(count, 3);
  for (int i = 0; i < count; ++i) {
    const auto t = mesh.triangles.row(random.below(mesh.triangles.rows()));
    const double s = random.uniform(), u = random.uniform() * (1 - s);
    const Vec3 on = (1 - s - u) * mesh.vertices.row(t[0]).transpose() +
                    s * mesh.vertices.row(t[1]).transpose() + u * mesh.vertices.row(t[2]).transpose();
    const Vec3 anywhere = 1.5 * Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const Vec3 kinds[5] = {anywhere, 1e3 * anywhere, on, on + 1e-3 * anywhere,
                           mesh.vertices.row(t[0]).transpose()};
    points.row(i) = kinds[i % 5].transpose();
  }
  return points;
}

}  // namespace arapfields::shapes
