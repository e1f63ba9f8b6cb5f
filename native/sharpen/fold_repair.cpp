// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/fold_repair.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

#include "energies/rotation.h"
#include "sharpen/folded_triangles.h"

namespace arapfields {
namespace {

/// Nodes that lie close together: at most so many, and all edges to others so many times as long as what lies
/// between them.
constexpr std::size_t most_close = 32;
constexpr double apart = 3.0;
/// Rounds that open triangles singly before what lies around them is relaxed; rings of nodes that are
/// relaxed, twice as many each time, at most; and how often for each.
constexpr int openings = 4, most_rings = 16, relaxations = 2;
/// Sweeps over the nodes that are relaxed, for rotations that are fitted anew so often.
constexpr int fits = 6, relaxing_sweeps = 8;

void sort_uniquely(std::vector<std::int32_t>& list) {
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
}

}  // namespace

FoldRepair::FoldRepair(const WeldedSurface& surface, const Points& start, const std::vector<char>& held,
                       const ContactLimits& limits, const Progress& progress)
    : surface_(surface), start_(start), held_(held), limits_(limits), progress_(progress) {}

bool FoldRepair::open_folds(Points& positions) {
  positions_ = positions;
  surface_.rotations(positions_, rotations_);
  const std::vector<char> now = all_folded(surface_, positions_, rotations_);
  folded_.clear();
  for (Index t = 0; t < surface_.triangles(); ++t)
    if (now[t]) folded_.push_back(static_cast<std::int32_t>(t));

  for (int rings = 1; rings <= most_rings && !folded_.empty(); rings *= 2) {
    round([&](Index t) { return move_as_one(t); });
    for (int i = 0; i < openings; ++i) round([&](Index t) { return open(t); });
    for (int i = 0; i < relaxations; ++i) round([&](Index t) { return relax(t, rings); });
  }
  positions = positions_;
  folded_.erase(std::remove_if(folded_.begin(), folded_.end(),
                               [&](std::int32_t t) { return is_folded(surface_, t, start_); }),
                folded_.end());
  return folded_.empty();
}

template <class Move>
void FoldRepair::round(Move&& move) {
  if (folded_.empty()) return;
  Nodes moved;
  for (const std::int32_t t : folded_) {
    progress_.check();
    const Nodes nodes = move(t);
    moved.insert(moved.end(), nodes.begin(), nodes.end());
  }
  if (limits_.any()) {
    const std::vector<char> kept = limits_.keep(positions_);
    for (Index i = 0; i < surface_.nodes(); ++i)
      if (kept[i]) moved.push_back(static_cast<std::int32_t>(i));
  }
  look_again(moved);
}

/// Finds the triangles that are folded after these nodes have moved.
void FoldRepair::look_again(const Nodes& moved) {
  Nodes turned = moved;
  for (const std::int32_t i : moved)
    turned.insert(turned.end(), surface_.neighbours().begin() + surface_.first_neighbour()[i],
                  surface_.neighbours().begin() + surface_.first_neighbour()[i + 1]);
  sort_uniquely(turned);
  std::vector<std::int32_t> near = folded_;
  for (const std::int32_t i : turned) {
    rotations_[i] = surface_.rotation(i, positions_);
    surface_.around(i, [&](Index t, int) { near.push_back(static_cast<std::int32_t>(t)); });
  }
  sort_uniquely(near);
  folded_.clear();
  for (const std::int32_t t : near)
    if (is_folded(surface_, t, positions_, rotations_)) folded_.push_back(t);
}

/// The shape that a triangle gets back: that at the start, or where it is folded there, at rest.
const Points& FoldRepair::shape_of(Index triangle) const {
  return is_folded(surface_, triangle, start_) ? surface_.rest() : start_;
}

/// Nodes within that many rings of a triangle, from the inner ones on.
FoldRepair::Nodes FoldRepair::nodes_around(Index triangle, int rings) const {
  Nodes result;
  std::unordered_set<std::int32_t> reached;
  const auto reach = [&](Index t) {
    for (int k = 0; k < 3; ++k)
      if (const std::int32_t node = surface_.corners()(t, k); reached.insert(node).second)
        result.push_back(node);
  };
  reach(triangle);
  std::size_t from = 0;
  for (int ring = 1; ring < rings; ++ring)
    for (const std::size_t end = result.size(); from < end; ++from)
      surface_.around(result[from], [&](Index t, int) { reach(t); });
  return result;
}

/// Nodes that lie close together around a triangle's shortest edge, all edges to others being much longer.
/// Empty where there are none.
FoldRepair::Nodes FoldRepair::close_nodes(Index triangle) const {
  const auto distance = [&](std::int32_t i, std::int32_t j) {
    return (surface_.rest().row(i) - surface_.rest().row(j)).norm();
  };
  Nodes result;
  double across = INFINITY;
  for (int k = 0; k < 3; ++k) {
    const std::int32_t i = surface_.corners()(triangle, k), j = surface_.corners()(triangle, (k + 1) % 3);
    if (const double length = distance(i, j); length < across) {
      across = length;
      result = {i, j};
    }
  }
  while (result.size() <= most_close) {
    double shortest = INFINITY;
    std::int32_t next = -1;
    for (const std::int32_t i : result)
      surface_.edges(i, [&](Index neighbour, const auto&) {
        const auto j = static_cast<std::int32_t>(neighbour);
        const double length = distance(i, j);
        if (length >= shortest || std::find(result.begin(), result.end(), j) != result.end()) return;
        shortest = length;
        next = j;
      });
    if (next < 0) return {};
    if (shortest > apart * across) return result;
    for (const std::int32_t i : result) across = std::max(across, distance(i, next));
    result.push_back(next);
  }
  return {};
}

/// The rotation that fits the edges of nodes best, from this shape on.
Mat3 FoldRepair::turn_of(const Nodes& nodes, const Points& shape) const {
  Mat3 spread = Mat3::Zero();
  for (const std::int32_t node : nodes)
    surface_.edges(node, [&](Index j, const auto& edge) {
      spread += edge.weight * (positions_.row(j) - positions_.row(node)).transpose() *
                (shape.row(j) - shape.row(node));
    });
  return closest_rotation(spread);
}

/// Gives the nodes that lie close together around a triangle their former shape, turned as the edges from
/// them to others are.
FoldRepair::Nodes FoldRepair::move_as_one(Index triangle) {
  const Nodes nodes = close_nodes(triangle);
  if (nodes.empty() || std::any_of(nodes.begin(), nodes.end(), [&](std::int32_t i) { return held_[i]; }))
    return {};
  const Points& shape = shape_of(triangle);
  const Mat3 turn = turn_of(nodes, shape);
  Eigen::RowVector3d before = Eigen::RowVector3d::Zero(), now = before;
  for (const std::int32_t i : nodes) {
    before += shape.row(i) / static_cast<double>(nodes.size());
    now += positions_.row(i) / static_cast<double>(nodes.size());
  }
  for (const std::int32_t i : nodes) positions_.row(i) = now + (shape.row(i) - before) * turn.transpose();
  return nodes;
}

/// Gives a triangle the height over its longest edge that it has in its former shape: of a thin triangle
/// the vertex there hardly moves.
FoldRepair::Nodes FoldRepair::open(Index t) {
  const Points& shape = shape_of(t);
  int apex = 0;
  double longest = -1.0;
  const auto corner = [&](int k) { return surface_.corners()(t, k % 3); };
  for (int k = 0; k < 3; ++k) {
    const double length = (shape.row(corner(k + 1)) - shape.row(corner(k + 2))).squaredNorm();
    if (length > longest && !held_[corner(k)]) {
      longest = length;
      apex = k;
    }
  }
  if (!(longest > 0.0)) return {};
  const auto from = corner(apex + 1), to = corner(apex + 2);
  const Vec3 base = shape.row(to) - shape.row(from), side = shape.row(corner(apex)) - shape.row(from);
  const double along = side.dot(base) / longest;
  const Vec3 height = side - along * base, edge = positions_.row(to) - positions_.row(from);
  // The height lies across the edge in the plane that the triangle should have.
  Mat3 turn = Mat3::Zero();
  for (int k = 0; k < 3; ++k) turn += rotations_[corner(k)];
  const Vec3 rest[3] = {surface_.rest().row(from), surface_.rest().row(to),
                        surface_.rest().row(corner(apex))};
  const Vec3 normal = turn * (rest[1] - rest[0]).cross(rest[2] - rest[0]);
  const Vec3 across = normal.cross(edge);
  if (!(across.norm() > 0.0)) return {};
  positions_.row(corner(apex)) =
      positions_.row(from) + (along * edge + height.norm() / across.norm() * across).transpose();
  return {corner(apex)};
}

/// Lets what is within so many rings of a triangle go as far back to its shape at rest as what is around it
/// lets: first turned as one, then each node by its own rotation.
FoldRepair::Nodes FoldRepair::relax(Index triangle, int rings) {
  const Nodes nodes = nodes_around(triangle, rings);
  const Points& rest = surface_.rest();
  const Mat3 whole = turn_of(nodes, rest);
  std::unordered_map<std::int32_t, Mat3> turns;
  for (const std::int32_t i : nodes) turns[i] = whole;
  const auto turn_at = [&](Index node, const Mat3& beyond) -> const Mat3& {
    const auto found = turns.find(static_cast<std::int32_t>(node));
    return found == turns.end() ? beyond : found->second;
  };
  for (int fit = 0; fit < fits; ++fit) {
    for (int sweep = 0; sweep < relaxing_sweeps; ++sweep)
      for (const std::int32_t i : nodes) {
        if (held_[i]) continue;
        const Mat3& own = turns[i];
        Vec3 sum = Vec3::Zero();
        double weights = 0.0;
        surface_.edges(i, [&](Index j, const auto& edge) {
          const Vec3 place = positions_.row(j);
          sum += edge.weight * place + 0.5 * (own + turn_at(j, own)) * edge.rest;
          weights += edge.weight;
        });
        positions_.row(i) = sum / weights;
      }
    for (const std::int32_t i : nodes) turns[i] = turn_of({i}, rest);
  }
  return nodes;
}

}  // namespace arapfields
