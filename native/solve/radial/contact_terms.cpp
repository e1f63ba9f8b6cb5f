// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_terms.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/errors.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Distance threshold for contact planes, in cube units: from an obstacle's margin, and in self-contact.
constexpr double near = 0.04, near_itself = 0.05;
/// Tolerance of the gap, in cube units, within which parts do not touch each other.
constexpr double slight = 2e-4;
/// Upper bound of self-contact's search distance, in cube units.
constexpr double farthest = 0.12;
/// Least cosine of the nearest normal with the normal where the path entered, for both to be on one side of
/// the obstacle: of a sheet, and of a solid, where sides that share an edge count as one.
constexpr double sheet_cosine = 0.3, solid_cosine = -0.5;
/// The cosine of neighbouring planes' normals below which an obstacle has an edge between them.
constexpr double smooth = 0.9;
/// Safety distance in self-contact, twice that of obstacles: both sides are known at samples alone.
constexpr double safety_distance_itself = 2.0 * ContactTerms::safety_distance;
/// Tolerance, in cube units, of the test whether a path may have crossed a surface: one that goes straight
/// through a sheet is exactly as long as the distances at its ends together.
constexpr double unsure = 1e-4;

/// Gives points whose path has entered a surface the tangent plane of the side that they entered by. `hits`
/// are those of the rows `moved_rows` of `now`; nearest normals within `reach` of that side are kept.
void go_back(const BarrierSurface& surface, PointsIn now, const std::vector<Index>& moved_rows,
             const std::vector<BarrierSurface::Hit>& hits, double reach, BarrierSurface::Nearest& nearest,
             Vector& offsets) {
  for (std::size_t m = 0; m < moved_rows.size(); ++m) {
    const BarrierSurface::Hit& hit = hits[m];
    if (hit.parameter > 1.0) continue;
    const Index i = moved_rows[m];
    const double beyond = hit.normal.dot(now.row(i).transpose() - hit.place);
    if (surface.is_sheet() && beyond < 0.0) {  // the side where the path began counts as outside
      nearest.normals.row(i) *= -1.0;
      nearest.distances[i] *= -1.0;
      offsets[i] *= -1.0;
    }
    if (nearest.distances[i] < reach &&
        nearest.normals.row(i).dot(hit.normal) > (surface.is_sheet() ? sheet_cosine : solid_cosine))
      continue;
    if (beyond > 0.0 && nearest.distances[i] > 0.0) continue;  // the point went around the surface
    nearest.normals.row(i) = hit.normal.transpose();
    nearest.distances[i] = beyond;
    offsets[i] = hit.normal.dot(hit.place);
  }
}

/// Makes the distances of points whose path hits the obstacle at most 0, so that they keep their side even
/// where the obstacle's edge has moved past them.
void hold_behind(const std::vector<BarrierSurface::Hit>& hits, const std::vector<Index>& rows,
                 Vector& distances) {
  for (std::size_t m = 0; m < rows.size(); ++m)
    if (hits[m].parameter <= 1.0) distances[rows[m]] = std::min(0.0, distances[rows[m]]);
}

/// Samples near an edge of an obstacle, which may poke through between them and their neighbours.
std::vector<Index> at_edges(const ContactSet& found, ContactPoints& points,
                            const std::vector<BarrierSurface>& surfaces) {
  std::vector<const ContactPlane*> of(static_cast<std::size_t>(points.sample_count()));
  std::vector<Index> edges;
  const double reach = 2.0 * points.spacing();
  std::size_t first = 0;
  while (first < found.planes.size()) {  // the planes of one surface are consecutive
    std::fill(of.begin(), of.end(), nullptr);
    const Index k = found.planes[first].obstacle;
    std::size_t last = first;
    for (; last < found.planes.size() && found.planes[last].obstacle == k; ++last)
      if (found.planes[last].first < points.sample_count())
        of[static_cast<std::size_t>(found.planes[last].first)] = &found.planes[last];
    for (; first < last && !surfaces[static_cast<std::size_t>(k)].is_ground(); ++first) {
      const ContactPlane& plane = found.planes[first];
      if (plane.first >= points.sample_count() || plane.initial_gap > reach) continue;
      for (const Index other : points.neighbours(plane.first)) {
        const ContactPlane* const beside = of[static_cast<std::size_t>(other)];
        if (beside == nullptr || beside->normal.dot(plane.normal) > smooth) continue;
        edges.push_back(plane.first);
        break;
      }
    }
    first = last;
  }
  return edges;
}

}  // namespace

void ContactTerms::set(const std::optional<Contact>& contact, const RowMatrix<double>& coefficients) {
  if (contact) {
    require_contact(*contact);
    require(!problem_.blend, "contact", "beside exact handles", "it needs handles that give way");
  }
  const bool goes_on = contact && contact_ && contact->itself == contact_->itself &&
                       contact->obstacles.size() == contact_->obstacles.size() &&
                       contact->ground.has_value() == contact_->ground.has_value();
  contact_ = contact;
  known_ = false;
  ended_.reset();
  if (goes_on) {
    const std::vector<BarrierSurface> before = std::exchange(surfaces_, {});
    gather_surfaces();
    places_ = points_.at(coefficients);
    for (Index k = 0; k < std::ssize(surfaces_); ++k) {
      BarrierSurface& surface = surfaces_[static_cast<std::size_t>(k)];
      if (surface.has_same_function(before[static_cast<std::size_t>(k)]))
        surface.set_placement(before[static_cast<std::size_t>(k)].placement());  // tracking continues
      else {
        start_tracking(k);
        sides_.find_crossings(k, surface, points_, places_);
      }
      starts_.push_back(surface.placement());
    }
    return;
  }
  gather_surfaces();
  self_.reset();
  if (contact_ && contact_->itself) self_.emplace(problem_, points_.samples(), safety_distance_itself);
  begin(coefficients);
}

bool ContactTerms::set_second_ground(const std::optional<Ground>& ground) {
  if (ground == second_ground_) return false;
  second_ground_ = ground;
  gather_surfaces();
  return true;
}

void ContactTerms::gather_surfaces() {
  surfaces_.clear();
  if (contact_) {
    for (const Obstacle& obstacle : contact_->obstacles) surfaces_.emplace_back(obstacle, problem_.frame());
    if (contact_->ground)
      surfaces_.push_back(BarrierSurface::ground({*contact_->ground, contact_->up}, problem_.frame()));
  }
  if (second_ground_) surfaces_.push_back(BarrierSurface::ground(*second_ground_, problem_.frame()));
  ends_.clear();
  for (const BarrierSurface& surface : surfaces_) ends_.push_back(surface.placement());
  obstacle_motions_.assign(surfaces_.size(), Mat4::Identity());
  starts_.clear();
  if (!surfaces_.empty() || (contact_ && contact_->itself)) points_.choose();
}

void ContactTerms::release() {
  known_ = known_ && deepest_ <= 0.0 && !touches_itself_;  // then no plane is active
  found_.revision = 0;
  found_.planes.clear();
  found_.places.resize(0, 3);
  found_.embedded.resize(0, 3);
  found_.stiffness = ContactSet::softest;
  pressures_.setZero();
  deepest_ = deepest_outside_ = 0.0;
  touches_itself_ = false;
}

/// Rows of points that may be within the distance threshold of a surface, by how far they have moved.
std::vector<Index> ContactTerms::near_rows() const {
  std::vector<Index> rows;
  for (Index i = 0; i < places_.rows(); ++i)
    for (Index k = 0; k < sides_.clearance.cols(); ++k) {
      const auto which = static_cast<std::size_t>(k);
      const double moved = (places_.row(i) - sides_.outside[which].row(i)).norm();
      if (sides_.clearance(i, k) - moved < near + extra_ + surfaces_[which].margin()) {
        rows.push_back(i);
        break;
      }
    }
  return rows;
}

/// Adds the planes of obstacles and grounds for these points, and updates their last outside positions.
void ContactTerms::find_outside(const std::vector<Index>& rows) {
  const Points now = rows_of(places_, rows);
  for (Index k = 0; k < sides_.clearance.cols(); ++k) {
    const Vector distances = add_planes(k, rows, now);
    for (Index i = 0; i < now.rows(); ++i) {
      if (distances[i] <= 0.0) continue;  // inside: keeps its last outside position
      const Index row = rows[static_cast<std::size_t>(i)];
      sides_.outside[static_cast<std::size_t>(k)].row(row) = now.row(i);
      sides_.clearance(row, k) = distances[i];
    }
  }
}

double ContactTerms::find(const RowMatrix<double>& coefficients, std::optional<double> extra, bool jumped) {
  if (known_ && !has_friction_ && !jumped && extra.value_or(0.0) <= extra_ && points_.is_at(coefficients))
    return deepest_;
  known_ = true;
  const Points before = std::exchange(places_, points_.at(coefficients));
  extra_ = extra ? *extra : std::sqrt((places_ - before).rowwise().squaredNorm().maxCoeff());
  has_friction_ = false;
  found_.planes.clear();
  deepest_ = 0.0;
  find_outside(near_rows());
  const std::vector<Index> edges = at_edges(found_, points_, surfaces_);
  const Index known = points_.size();
  points_.refine(edges);
  if (points_.size() > known) {
    const Points finer = points_.at(coefficients).bottomRows(points_.size() - known);
    places_.conservativeResize(points_.size(), Eigen::NoChange);
    places_.bottomRows(finer.rows()) = finer;
    pressures_.conservativeResize(places_.rows(), Eigen::NoChange);
    pressures_.bottomRows(finer.rows()).setZero();
    extend_sides();
    std::vector<Index> rows(static_cast<std::size_t>(finer.rows()));
    std::iota(rows.begin(), rows.end(), known);
    find_outside(rows);
  }
  deepest_outside_ = deepest_;
  ahead_ = false;
  if (self_) add_own_planes(coefficients, jumped);
  gather_places();
  return deepest_;
}

/// Adds the planes of surface k for points (rows) at positions `now`. Returns their signed distances, which
/// are negative also for points that have tunnelled through it.
Vector ContactTerms::add_planes(Index k, const std::vector<Index>& rows, PointsIn now) {
  const BarrierSurface& surface = surfaces_[static_cast<std::size_t>(k)];
  const Points& outside = sides_.outside[static_cast<std::size_t>(k)];
  BarrierSurface::Nearest nearest = surface.nearest(now);
  std::vector<Index> moved_rows, starts;  // points that may have crossed: rows of `now`, and of all points
  for (Index i = 0; i < now.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const double moved = (now.row(i) - outside.row(row)).norm(), clearance = sides_.clearance(row, k);
    if (clearance > 0.0 && moved > clearance + std::max(0.0, nearest.distances[i]) - unsure)
      moved_rows.push_back(i), starts.push_back(row);
  }
  const std::vector<BarrierSurface::Hit> hits =
      surface.first_hits(rows_of(outside, starts), rows_of(now, moved_rows));
  Vector offsets(now.rows());
  for (Index i = 0; i < now.rows(); ++i)
    offsets[i] = nearest.normals.row(i).dot(now.row(i)) - nearest.distances[i];
  go_back(surface, now, moved_rows, hits, near + extra_, nearest, offsets);
  const Points carried = affine_image(now, obstacle_motions_[static_cast<std::size_t>(k)]);
  for (Index i = 0; i < now.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const bool crossed = sides_.crosses(k, points_.sample_of(row));
    double margin = surface.margin() + safety_distance;
    if (crossed) margin = std::clamp(sides_.clearance(row, k), 0.0, margin);  // not more than it had at first
    const double gap = nearest.distances[i] - margin;
    const bool left = sides_.clearance(row, k) == ContactSides::left_inside && nearest.distances[i] < 0.0;
    if (left || gap > near + extra_) {
      pressures_(row, k) = 0.0;
      continue;
    }
    deepest_ = std::max(deepest_, -gap - safety_distance);
    ContactPlane& plane = found_.planes.emplace_back();
    plane.first = row;
    plane.normal = nearest.normals.row(i).transpose();
    plane.offset = offsets[i] + margin;
    plane.initial_gap = gap;
    plane.pressure = pressures_(row, k);
    plane.area = points_.area(row);
    plane.obstacle = k;
    plane.anchor = carried.row(i).transpose();
    auto anchor = sides_.anchors[static_cast<std::size_t>(k)].row(row);
    if (plane.pressure > 0.0) {  // the anchor follows a sliding point at the distance `stuck`
      const Vec3 slip = plane.along(plane.anchor - anchor.transpose());
      plane.anchor -= std::min(1.0, stuck / slip.norm()) * slip;
    }
    anchor = plane.anchor.transpose();
  }
  if (ahead_) hold_behind(hits, moved_rows, nearest.distances);
  return nearest.distances;
}

/// Adds the planes of self-contact.
void ContactTerms::add_own_planes(const RowMatrix<double>& coefficients, bool jumped) {
  const Index own = pressures_.cols() - 1;
  const Vector before = pressures_.col(own);
  touches_itself_ = false;
  pressures_.col(own).setZero();
  const auto normals = [&](auto* blocks) { return points_.normals_at(coefficients, blocks); };
  const Points samples = places_.topRows(points_.sample_count());
  for (const FacingPair& pair :
       self_->find(samples, normals, std::min(near_itself + extra_, farthest), jumped)) {
    pressures_(pair.first, own) = before[pair.first];
    deepest_ = std::max(deepest_, pair.least - safety_distance - pair.gap);
    touches_itself_ = touches_itself_ || pair.gap < pair.least - slight;
    ContactPlane& plane = found_.planes.emplace_back();
    plane.first = pair.first;
    plane.second = pair.second;
    plane.normal = pair.normal;
    plane.offset = pair.least;
    plane.pressure = before[pair.first];
    plane.area = points_.area(pair.first);
    plane.obstacle = own;
  }
}

bool ContactTerms::overlaps(const RowMatrix<double>& coefficients) {
  return self_ && self_->overlaps(points_.at(coefficients).topRows(points_.sample_count()),
                                  points_.normals_at(coefficients));
}

}  // namespace arapfields
