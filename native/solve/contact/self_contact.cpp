// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/self_contact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/point_grid.h"
#include "core/types.h"
#include "distance/triangle_crossings.h"
#include "fields/radial_evaluator.h"
#include "mesh/is_closed.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "solve/contact/parameters.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// Signs of the offset along the normal.
constexpr double outwards = 1.0, inwards = -1.0;

/// The blocks of a RadialEvaluator that contain these rows (ascending).
std::vector<Index> blocks_of(const std::vector<Index>& rows) {
  std::vector<Index> blocks;
  for (const Index row : rows)
    if (const Index block = row / RadialEvaluator<float>::block_size;
        blocks.empty() || blocks.back() != block)
      blocks.push_back(block);
  return blocks;
}

}  // namespace

SelfContact::SelfContact(const RadialProblem& problem, const std::vector<Index>& rows,
                         double safety_distance) {
  const SurfaceSamples& samples = problem.samples;
  require(samples.normals.rows() == samples.size(), "itself", "samples without normals",
          "normals are needed");
  const Points places = rows_of(samples.points, rows), normals = rows_of(samples.normals, rows);
  const auto n = places.rows();
  inside_ = RowMatrix<double>::Zero(n, 6);
  inside_.leftCols(3) = places;
  if (problem.basis.embedding) {
    Points embedded(n, 3);
    problem.basis.embedding->evaluate(places, {embedded.data(), n, JetOrder::value});
    inside_.rightCols(3) = embedded;
  }
  if (!samples.mesh_indices.empty())
    for (const Index row : rows) meshes_.push_back(samples.mesh_indices[static_cast<std::size_t>(row)]);
  widths_ = 2.0 * problem.shape->thickness->at(places);
  normals_ = normals;
  RowMatrix<double> rest = RowMatrix<double>::Zero(n, 8);
  rest.leftCols(6) = inside_;
  for (std::size_t i = 0; i < meshes_.size(); ++i)
    rest(static_cast<Index>(i), 6) = P::meshes_apart * meshes_[i];
  runs_.emplace(std::move(rest), P::far_inside);
  const PointGrid grid(places, P::gap_at_rest);  // a cell holds about gap_at_rest² of the surface's area
  const double share = static_cast<double>(grid.size()) / static_cast<double>(n);
  most_offset_ = P::most_offset * P::gap_at_rest * std::sqrt(share);
  safety_distance_ = safety_distance;
  for (Index i = 0; i < n; i += std::max<Index>(1, n / P::most_probes)) probes_.push_back(i);
  measure_rest(places);
  least_gaps_ = Vector::Constant(n, safety_distance);
  Vector at_rest = least_gaps_;
  for (const FacingPair& pair :
       search(places, [&](auto*) { return normals; }, P::gap_at_rest, Penetrations::at_rest))
    for (const Index i : {pair.first, pair.second})
      at_rest[i] = std::min(at_rest[i], std::max(0.0, pair.gap));
  least_gaps_ = (windings_above_.array() > P::inside_at_rest).select(0.0, at_rest);
}

/// Scales the winding numbers to a jump of 1 across the surface, and computes those at rest.
void SelfContact::measure_rest(PointsIn places) {
  const SampleWindings at_rest(places, normals_, most_offset_);
  windings_above_.resize(places.rows());
  parallel_for(0, windings_above_.size(), 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) windings_above_[i] = winding(at_rest, i, outwards, places, normals_);
  });
  windings_below_ = windings_below(at_rest, places, normals_);
  Vector jumps = windings_below_ - windings_above_(probes_);
  const Index half = jumps.size() / 2;
  std::nth_element(jumps.begin(), jumps.begin() + half, jumps.end());
  winding_scale_ = 1.0 / std::max(jumps[half], 1e-12);  // the median jump becomes 1
  windings_below_ *= winding_scale_;
  windings_above_ *= winding_scale_;
  is_cut_ = windings_below_.maxCoeff() > 1.0 + P::inside_another;
  if (is_cut_) find_cuts(places);
}

/// Finds for each sample the nearest one inside another part at rest, and drops the probes near such samples.
void SelfContact::find_cuts(PointsIn places) {
  std::vector<Index> within, kept;
  for (Index i = 0; i < windings_above_.size(); ++i)
    if (windings_above_[i] > P::inside_at_rest) within.push_back(i);
  if (within.empty()) return;
  const auto alike = [](const Points& points) -> Points { return Points::Zero(points.rows(), 3); };
  const Points cuts = rows_of(places, within);
  cuts_ = rows_of(cuts, OrientedPoints(cuts, alike(cuts)).nearest(places, alike(places), 0.0));
  std::vector<Index> probes;
  for (Index k = 0; k < windings_below_.size(); ++k) {
    const Index i = probes_[static_cast<std::size_t>(k)];
    if ((places.row(i) - cuts_.row(i)).norm() < P::near_a_cut) continue;
    kept.push_back(k);
    probes.push_back(i);
  }
  windings_below_ = entries_of(windings_below_, kept);
  probes_ = std::move(probes);
}

bool SelfContact::is_far(Index i, Index j, double distance) const {
  if (!meshes_.empty() && meshes_[static_cast<std::size_t>(i)] != meshes_[static_cast<std::size_t>(j)])
    return true;
  return (inside_.row(i) - inside_.row(j)).squaredNorm() > distance * distance;
}

/// Whether a pair is excluded because parts intersect at rest: its samples are near each other by a path
/// through the intersection, or near each other with one behind the other.
bool SelfContact::is_cut(Index i, Index j) const {
  if (!is_cut_) return false;
  const auto at = [&](Index k) { return inside_.row(k).leftCols<3>(); };
  const Vec3 arm = (at(i) - at(j)).transpose();
  if (arm.squaredNorm() < P::near_a_cut * P::near_a_cut &&
      std::min(normals_.row(j).dot(arm), -normals_.row(i).dot(arm)) < safety_distance_)
    return true;
  return cuts_.rows() > 0 && (at(i) - cuts_.row(i)).norm() + (cuts_.row(i) - cuts_.row(j)).norm() +
                                     (cuts_.row(j) - at(j)).norm() <
                                 P::far_inside;
}

/// Whether sample i, behind sample j's tangent plane, has passed through it: at the last search i was paired
/// with the same part, or in front of j.
bool SelfContact::came_through(Index i, Index j, const Vec3& normal, const Search& last) const {
  const Index before = last.faced[static_cast<std::size_t>(i)];
  return (before >= 0 && !is_far(before, j, P::far_inside)) ||
         (last.places.row(i) - last.places.row(j)).dot(normal.transpose()) >= 0.0;
}

bool SelfContact::may_meet(Index i, Index j) const {
  return least_gaps_[i] > 0.0 && least_gaps_[j] > 0.0 && is_far(i, j, P::far_inside) && !is_cut(i, j);
}

std::vector<bool> SelfContact::beside_others(PointsIn places, double near) const {
  std::vector<bool> result(static_cast<std::size_t>(places.rows()));
  const auto near_to =
      runs_->meeting(places, Points(0, 3), least_gaps_.array() > 0.0, near, P::facing_cosine);
  for (Index run = 0; run < runs_->count(); ++run)
    for (const Index i : runs_->samples(run))
      result[static_cast<std::size_t>(i)] = !near_to[static_cast<std::size_t>(run)].empty();
  return result;
}

/// Whether a gap along the normal of sample j makes a pair.
bool SelfContact::is_gap(double gap, Index i, Index j, const Vec3& normal, Penetrations penetrations,
                         const Search& last) const {
  switch (penetrations) {
    case Penetrations::none:
      return gap >= 0.0;
    case Penetrations::as_came:
      return gap >= 0.0 || came_through(i, j, normal, last);
    case Penetrations::shallow:
      return gap >= -P::shallow;
    default:
      return true;
  }
}

/// The nearest sample within `near` that sample i faces, out of these runs; −1: none.
Index SelfContact::faced_by(Index i, const std::vector<Index>& runs, PointsIn places, const Points& normals,
                            double near, Penetrations penetrations, const Search& last) const {
  if (least_gaps_[i] <= 0.0) return -1;
  const Vec3 place = places.row(i).transpose(), normal = normals.row(i).transpose();
  Index faced = -1;
  double nearest = near * near;
  for (const Index run : runs)
    for (const Index j : runs_->samples(run)) {
      const Vec3 arm = place - places.row(j).transpose();
      const double square = arm.squaredNorm();
      if (square >= nearest) continue;
      const Vec3 other = normals.row(j).transpose();
      const double gap = arm.dot(other);
      if (normal.dot(other) > P::facing_cosine || square - gap * gap > most_offset_ * most_offset_) continue;
      if (-gap > std::min(widths_[i], widths_[j]) || !may_meet(i, j)) continue;
      if (!is_gap(gap, i, j, other, penetrations, last)) continue;
      nearest = square;
      faced = j;
    }
  return faced;
}

std::vector<FacingPair> SelfContact::search(PointsIn places, const Normals& normals_at, double near,
                                            Penetrations penetrations, const Search& last) {
  Points areas;  // all normals at once if the last search needed them for winding numbers
  if (std::exchange(penetrates_, false)) areas = normals_at(nullptr);
  Points normals = unit_rows(areas);
  const std::vector<std::vector<Index>> near_to =
      runs_->meeting(places, normals, least_gaps_.array() > 0.0, near, P::facing_cosine);
  std::vector<Index> runs, samples;
  for (Index run = 0; run < runs_->count(); ++run) {
    if (near_to[static_cast<std::size_t>(run)].empty()) continue;
    runs.push_back(run);
    for (const Index i : runs_->samples(run)) samples.push_back(i);
  }
  if (runs.empty()) return {};
  std::sort(samples.begin(), samples.end());
  if (normals.rows() == 0) {
    const std::vector<Index> blocks = blocks_of(samples);
    normals = normals_at(&blocks);
    for (const Index i : samples) normals.row(i).normalize();
  }
  std::vector<Index> faced(static_cast<std::size_t>(places.rows()), -1);
  const auto look = [&](Penetrations which, const auto& wanted) {
    parallel_for(0, std::ssize(runs), 32, [&](Index begun, Index ended) {
      for (Index k = begun; k < ended; ++k) {
        const Index run = runs[static_cast<std::size_t>(k)];
        for (const Index i : runs_->samples(run))
          if (wanted(i))
            faced[static_cast<std::size_t>(i)] =
                faced_by(i, near_to[static_cast<std::size_t>(run)], places, normals, near, which, last);
      }
    });
  };
  look(penetrations, [](Index) { return true; });
  const auto penetrates = [&](Index i) {
    const Index j = faced[static_cast<std::size_t>(i)];
    return j >= 0 && normals.row(j).dot(places.row(i) - places.row(j)) < 0.0;
  };
  penetrates_ =
      penetrations != Penetrations::at_rest && std::any_of(samples.begin(), samples.end(), penetrates);
  if (penetrates_) {
    if (areas.rows() == 0) areas = normals_at(nullptr);
    const SampleWindings now(places, winding_scale_ * areas, most_offset_);
    look(Penetrations::none, [&](Index i) {  // outside by its winding number: opposite sides of one thin part
      return penetrates(i) && winding(now, i, outwards, places, areas) - windings_above_[i] < P::entered;
    });
  }
  std::vector<FacingPair> pairs;
  for (const Index i : samples) {
    const Index j = faced[static_cast<std::size_t>(i)];
    if (j < 0) continue;
    const Vec3 normal = normals.row(j).transpose();
    pairs.push_back({i, j, normal, normal.dot((places.row(i) - places.row(j)).transpose()),
                     std::min(least_gaps_[i], least_gaps_[j])});
  }
  return pairs;
}

/// The winding number at a small offset from a sample along its normal, outwards or inwards by `side`.
double SelfContact::winding(const SampleWindings& windings, Index i, double side, PointsIn places,
                            PointsIn normals) const {
  const double offset = side * std::min(most_offset_, 0.5 * widths_[i]);
  return windings.at((places.row(i) + offset * normals.row(i).normalized()).transpose());
}

/// Winding numbers at the inward offsets of the probes.
Vector SelfContact::windings_below(const SampleWindings& windings, PointsIn places, PointsIn normals) const {
  Vector result(std::ssize(probes_));
  for (Index k = 0; k < result.size(); ++k)
    result[k] = winding(windings, probes_[static_cast<std::size_t>(k)], inwards, places, normals);
  return result;
}

bool SelfContact::overlaps(PointsIn places, PointsIn normals) const {
  if (probes_.empty()) return false;
  const SampleWindings now(places, winding_scale_ * normals, most_offset_);
  const Vector change = windings_below(now, places, normals) - windings_below_;
  return change.lpNorm<Eigen::Infinity>() > P::inside_another;
}

SelfContact::Search SelfContact::search_of(PointsIn places, const std::vector<FacingPair>& pairs) {
  Search result{places, std::vector<Index>(static_cast<std::size_t>(places.rows()), -1)};
  for (const FacingPair& pair : pairs) result.faced[static_cast<std::size_t>(pair.first)] = pair.second;
  return result;
}

SelfContact::Search SelfContact::begin(PointsIn places, const Normals& normals) {
  return search_of(places, search(places, normals, P::gap_at_rest, Penetrations::shallow));
}

std::vector<FacingPair> SelfContact::find(PointsIn places, const Normals& normals, double near, bool jumped,
                                          Search& last) {
  std::vector<FacingPair> pairs =
      search(places, normals, near, jumped ? Penetrations::all : Penetrations::as_came, last);
  last = search_of(places, pairs);
  return pairs;
}

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
