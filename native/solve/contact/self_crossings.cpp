// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/self_crossings.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <set>
#include <utility>

#include "core/unit_rows.h"
#include "distance/triangle_crossings.h"
#include "mesh/is_closed.h"
#include "sampling/sample_choice.h"
#include "solve/contact/parameters.h"

namespace arapfields {
namespace {

using P = ContactParameters;

}  // namespace

SelfCrossings::SelfCrossings(const RadialProblem& problem, const std::vector<Index>& rows, double spacing)
    : problem_(problem),
      samples_(rows_of(problem.samples.points, rows)),
      normals_(unit_rows(rows_of(problem.samples.normals, rows))),
      spacing_(spacing) {}

Vec3 SelfCrossings::rest_at(Index triangle, const Vec3& at) const {
  const auto corners = problem_.samples.mesh->triangles.row(triangle);
  return mesh_->rest(corners, Eigen::all).transpose() * at;
}

/// The contact samples nearest to places (n,3) on these triangles, on the same side of a thin part.
std::vector<Index> SelfCrossings::nearest(const Points& places, const std::vector<Index>& triangles) const {
  Points areas(places.rows(), 3);
  for (Index i = 0; i < places.rows(); ++i) {
    const Points corners =
        mesh_->rest(problem_.samples.mesh->triangles.row(triangles[static_cast<std::size_t>(i)]), Eigen::all);
    const Vec3 first = corners.row(1) - corners.row(0), second = corners.row(2) - corners.row(0);
    areas.row(i) = first.cross(second).transpose();
  }
  return mesh_->samples.nearest(places, unit_rows(areas), spacing_);
}

const SelfCrossings::Mesh& SelfCrossings::mesh() {
  if (mesh_) return *mesh_;
  const TriangleMesh& mesh = *problem_.samples.mesh;
  mesh_.emplace();
  mesh_->rest = problem_.frame().to_cube(mesh.vertices);
  mesh_->same = first_at_position(mesh.vertices);
  mesh_->samples = OrientedPoints(samples_, normals_);
  const Index count = mesh.triangles.rows();
  Points middles(count, 3);
  std::vector<Index> all;
  for (Index t = 0; t < count; ++t) {
    middles.row(t) = rest_at(t, Vec3::Constant(1.0 / 3.0)).transpose();
    all.push_back(t);
  }
  mesh_->owners = nearest(middles, all);
  mesh_->reaching.resize(static_cast<std::size_t>(count));
  for (Index t = 0; t < count; ++t)
    for (int k = 0; k < 3; ++k)
      if ((mesh_->rest.row(mesh.triangles(t, k)) - samples_.row(mesh_->owners[static_cast<std::size_t>(t)]))
              .norm() > P::triangle_reach * spacing_)
        mesh_->reaching[static_cast<std::size_t>(t)] = true;
  return *mesh_;
}

std::vector<SelfCrossing> SelfCrossings::find(const SelfContact& contact, PointsIn places, const Field& field,
                                              const Progress& progress) {
  if (!knows_mesh()) return {};
  const std::vector<bool> beside = contact.beside_others(places, P::crossing_distance * spacing_);
  if (std::find(beside.begin(), beside.end(), true) == beside.end()) return {};
  const Mesh& known = mesh();
  const Triangles& triangles = problem_.samples.mesh->triangles;
  // The triangles that are looked at, and their vertices.
  std::vector<Index> chosen, used;
  std::vector<std::int32_t> number(static_cast<std::size_t>(known.rest.rows()), -1);
  for (Index t = 0; t < triangles.rows(); ++t) {
    const auto which = static_cast<std::size_t>(t);
    if (!known.reaching[which] && !beside[static_cast<std::size_t>(known.owners[which])]) continue;
    chosen.push_back(t);
    for (int k = 0; k < 3; ++k) {
      std::int32_t& at = number[static_cast<std::size_t>(triangles(t, k))];
      if (at < 0) at = static_cast<std::int32_t>(used.size()), used.push_back(triangles(t, k));
    }
  }
  Triangles part(std::ssize(chosen), 3);
  for (Index i = 0; i < part.rows(); ++i)
    for (int k = 0; k < 3; ++k)
      part(i, k) = number[static_cast<std::size_t>(triangles(chosen[static_cast<std::size_t>(i)], k))];
  std::vector<std::int32_t> same;
  for (const Index v : used) same.push_back(known.same[static_cast<std::size_t>(v)]);
  const Points rest = rows_of(known.rest, used), now = field(rest);
  // One crossing of each pair, between parts that contact keeps apart.
  std::set<std::pair<std::int32_t, std::int32_t>> pairs;
  std::vector<TriangleCrossing> found;
  for (const TriangleCrossing& each : triangle_crossings(now, part, same, progress))
    if (pairs.insert(std::minmax(each.edge_of, each.through)).second) found.push_back(each);
  if (found.empty()) return {};
  Points first(std::ssize(found), 3), second(std::ssize(found), 3);
  std::vector<Index> first_of, second_of;
  for (std::size_t i = 0; i < found.size(); ++i) {
    first_of.push_back(chosen[static_cast<std::size_t>(found[i].edge_of)]);
    second_of.push_back(chosen[static_cast<std::size_t>(found[i].through)]);
    first.row(static_cast<Index>(i)) = rest_at(first_of.back(), found[i].edge_at).transpose();
    second.row(static_cast<Index>(i)) = rest_at(second_of.back(), found[i].through_at).transpose();
  }
  const std::vector<Index> firsts = nearest(first, first_of), seconds = nearest(second, second_of);
  // Pairs that cross at rest.
  Triangles involved(2 * std::ssize(found), 3);
  for (std::size_t i = 0; i < found.size(); ++i) {
    involved.row(2 * static_cast<Index>(i)) = part.row(found[i].edge_of);
    involved.row(2 * static_cast<Index>(i) + 1) = part.row(found[i].through);
  }
  std::vector<bool> at_rest(found.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    at_rest[i] = !triangle_crossings(rest, involved.middleRows(2 * static_cast<Index>(i), 2), same).empty();
  std::vector<SelfCrossing> result;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (at_rest[i] || !contact.may_meet(firsts[i], seconds[i])) continue;
    const Vec3 place = now(part.row(found[i].edge_of), Eigen::all).transpose() * found[i].edge_at;
    result.push_back({firsts[i], seconds[i], place});
  }
  return result;
}

}  // namespace arapfields
