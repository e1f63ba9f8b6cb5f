// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/styles.h"

#include <cmath>
#include <numbers>

#include "core/errors.h"

namespace arapfields {
namespace {

using Rows = std::vector<Vec3>;

/// `count` directions around the z axis, the first along x, raised by `elevation` above the xy plane.
Rows ring(int count, double elevation) {
  Rows rows;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / count;
    rows.emplace_back(std::cos(elevation) * std::cos(angle), std::cos(elevation) * std::sin(angle),
                      std::sin(elevation));
  }
  return rows;
}

Rows prism(int sides) {
  Rows rows = ring(sides, 0.0);
  rows.emplace_back(0, 0, 1);
  rows.emplace_back(0, 0, -1);
  return rows;
}

/// Face normals of a pyramid with this many sides, which rise by 30° above the base plane.
Rows pyramid(int sides) {
  Rows rows = ring(sides, std::numbers::pi / 6.0);
  rows.emplace_back(0, 0, -1);
  return rows;
}

/// All sign changes of (a, b, c), each once.
Rows signs(double a, double b, double c) {
  Rows rows;
  for (int i = 0; i < 8; ++i) {
    const Vec3 row((i & 1) != 0 ? -a : a, (i & 2) != 0 ? -b : b, (i & 4) != 0 ? -c : c);
    if (((i & 1) != 0 && a == 0) || ((i & 2) != 0 && b == 0) || ((i & 4) != 0 && c == 0)) continue;
    rows.push_back(row.normalized());
  }
  return rows;
}

Rows joined(std::initializer_list<Rows> parts) {
  Rows rows;
  for (const Rows& part : parts) rows.insert(rows.end(), part.begin(), part.end());
  return rows;
}

constexpr double golden = std::numbers::phi;

struct NamedStyle {
  const char* name;
  Rows (*normals)();
};

constexpr NamedStyle styles[] = {
    {"cube", [] { return joined({signs(1, 0, 0), signs(0, 1, 0), signs(0, 0, 1)}); }},
    {"tetrahedron",
     [] {
       const double s = 1.0 / std::sqrt(3.0);
       return Rows{{s, s, s}, {s, -s, -s}, {-s, s, -s}, {-s, -s, s}};
     }},
    {"octahedron", [] { return signs(1, 1, 1); }},
    {"dodecahedron", [] { return joined({signs(0, 1, golden), signs(1, golden, 0), signs(golden, 0, 1)}); }},
    {"icosahedron",
     [] {
       return joined({signs(1, 1, 1), signs(0, 1 / golden, golden), signs(1 / golden, golden, 0),
                      signs(golden, 0, 1 / golden)});
     }},
    {"square prism", [] { return prism(4); }},
    {"hexagonal prism", [] { return prism(6); }},
    {"triangular prism", [] { return prism(3); }},
    {"square pyramid", [] { return pyramid(4); }},
    {"hexagonal pyramid", [] { return pyramid(6); }},
    {"triangular pyramid", [] { return pyramid(3); }},
    {"cylinder", [] { return prism(32); }},
    {"cone", [] { return pyramid(32); }},
    {"plane pair", [] { return signs(0, 0, 1); }},
};

}  // namespace

std::vector<std::string> style_names() {
  std::vector<std::string> names;
  for (const NamedStyle& style : styles) names.emplace_back(style.name);
  return names;
}

Points preferred_normals(const std::string& name) {
  std::string known;
  for (const NamedStyle& style : styles) {
    if (name == style.name) {
      const Rows rows = style.normals();
      Points result(static_cast<Index>(rows.size()), 3);
      for (std::size_t i = 0; i < rows.size(); ++i) result.row(i) = rows[i].transpose();
      return result;
    }
    known += (known.empty() ? "" : ", ") + std::string(style.name);
  }
  throw InvalidInput("style", "unknown name '" + name + "'", "known are " + known);
}

}  // namespace arapfields
