// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_terms.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "fields/radial_field.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Distance threshold for contact planes, in cube units: from an obstacle's margin, and in self-contact.
constexpr double near = 0.04, near_itself = 0.05;
/// Tolerance of the gap, in cube units, within which parts do not touch each other.
constexpr double slight = 2e-4;
/// Largest margin, height of a ground above the shape and distance of an obstacle, in cube units.
constexpr double farthest_placed = 1e6;
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
std::vector<Index> at_edges(const std::vector<ContactPlane>& planes, ContactPoints& points,
                            const std::vector<BarrierSurface>& surfaces) {
  std::vector<const ContactPlane*> of(static_cast<std::size_t>(points.sample_count()));
  std::vector<Index> edges;
  const double reach = 2.0 * points.spacing();
  std::size_t first = 0;
  while (first < planes.size()) {  // the planes of one surface are consecutive
    std::fill(of.begin(), of.end(), nullptr);
    const Index k = planes[first].obstacle;
    std::size_t last = first;
    for (; last < planes.size() && planes[last].obstacle == k; ++last)
      if (planes[last].first < points.sample_count())
        of[static_cast<std::size_t>(planes[last].first)] = &planes[last];
    for (; first < last && !surfaces[static_cast<std::size_t>(k)].is_ground(); ++first) {
      const ContactPlane& plane = planes[first];
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

std::vector<Mat4> placements_of(const std::vector<BarrierSurface>& surfaces) {
  std::vector<Mat4> placements;
  for (const BarrierSurface& surface : surfaces) placements.push_back(surface.placement());
  return placements;
}

}  // namespace

void ContactTerms::set(const std::optional<Contact>& contact, const RowMatrix<double>& coefficients) {
  if (contact) {
    require_contact(*contact);
    require(!problem_.blend, "contact", "beside exact handles", "it needs handles that give way");
  }
  const bool goes_on = history_ && contact && contact_ && contact->itself == contact_->itself &&
                       contact->obstacles.size() == contact_->obstacles.size() &&
                       contact->ground.has_value() == contact_->ground.has_value();
  known_ = false;
  ended_.reset();
  std::vector<BarrierSurface> next = surfaces_of(contact, second_ground_);
  if (!goes_on) {
    std::optional<SelfContact> self;
    std::optional<SelfCrossings> crossings;
    if (contact && contact->itself) {
      self.emplace(problem_, points_.samples(), safety_distance_itself);
      crossings.emplace(problem_, points_.samples(), points_.spacing());
    }
    forget();
    contact_ = contact;
    self_ = std::move(self);
    crossings_.reset();
    if (crossings) crossings_.emplace(*std::move(crossings));
    set_surfaces(std::move(next));
    return begin(coefficients);
  }
  std::vector<Mat4> ends = placements_of(next);
  ContactHistory history = *history_;
  points_.set_refined(history.refined);
  history.places = points_.at(coefficients);
  for (Index k = 0; k < std::ssize(next); ++k) {
    BarrierSurface& surface = next[static_cast<std::size_t>(k)];
    const BarrierSurface& before = surfaces_[static_cast<std::size_t>(k)];
    if (surface.has_same_function(before))
      surface.set_placement(before.placement());  // tracking continues
    else {
      history.sides.start(k, surface, history.places);
      history.sides.find_crossings(k, surface, points_, history.places);
    }
  }
  contact_ = contact;
  history_ = std::move(history);
  set_surfaces(std::move(next));
  ends_ = std::move(ends);
}

void ContactTerms::set_second_ground(const std::optional<Ground>& ground,
                                     const RowMatrix<double>& coefficients) {
  if (ground == second_ground_) return;
  std::vector<BarrierSurface> next = surfaces_of(contact_, ground);
  forget();
  second_ground_ = ground;
  set_surfaces(std::move(next));
  begin(coefficients);
}

/// The surfaces of a contact; chooses the contact points, if it needs any. Throws InvalidInput for what is
/// too far from the shape for the precision of places.
std::vector<BarrierSurface> ContactTerms::surfaces_of(const std::optional<Contact>& contact,
                                                      const std::optional<Ground>& second_ground) {
  std::vector<BarrierSurface> surfaces;
  const Frame& frame = problem_.frame();
  const std::string allowed = "at most " + number_text(farthest_placed * frame.scale) +
                              " is allowed, a million times half the shape's size";
  const auto add_ground = [&](const Ground& ground) {
    const double above = ground.height - frame.center.dot(ground.up.normalized());
    require(above <= farthest_placed * frame.scale, "ground", number_text(above) + " above the shape",
            allowed);
    surfaces.push_back(BarrierSurface::ground(ground, frame));
  };
  for (std::size_t i = 0; contact && i < contact->obstacles.size(); ++i) {
    const Obstacle& obstacle = contact->obstacles[i];
    const std::string name = "obstacles[" + std::to_string(i) + "]";
    require(obstacle.margin <= farthest_placed * frame.scale, name + ".margin", number_text(obstacle.margin),
            allowed);
    surfaces.emplace_back(obstacle, frame);
    const double reach = surfaces.back().placement().topRows<3>().cwiseAbs().maxCoeff();
    require(reach <= farthest_placed, name + ".placement",
            number_text(frame.scale * reach) + " from the shape", allowed);
  }
  if (contact && contact->ground) add_ground({*contact->ground, contact->up});
  if (second_ground) add_ground(*second_ground);
  if (!surfaces.empty() || (contact && contact->itself)) points_.choose();
  return surfaces;
}

void ContactTerms::set_surfaces(std::vector<BarrierSurface> surfaces) {
  surfaces_ = std::move(surfaces);
  starts_ = ends_ = placements_of(surfaces_);
  obstacle_motions_.assign(surfaces_.size(), Mat4::Identity());
}

/// Ends the tracking: no planes are left of it.
void ContactTerms::forget() {
  history_.reset();
  release();
  known_ = false;
}

void ContactTerms::release() {
  known_ = known_ && deepest_ <= 0.0 && !touches_itself_;  // then no plane is active
  found_.revision = 0;
  found_.planes.clear();
  found_.places.resize(0, 3);
  found_.embedded.resize(0, 3);
  found_.stiffness = ContactSet::softest;
  if (history_) history_->pressures.setZero();
  deepest_ = deepest_outside_ = 0.0;
  touches_itself_ = false;
}

/// Rows of points that may be within the distance threshold of a surface, by how far they have moved.
std::vector<Index> ContactTerms::near_rows() const {
  const ContactHistory& history = *history_;
  const ContactSides& sides = history.sides;
  std::vector<Index> rows;
  for (Index i = 0; i < history.places.rows(); ++i)
    for (Index k = 0; k < sides.clearance.cols(); ++k) {
      const auto which = static_cast<std::size_t>(k);
      const double moved = (history.places.row(i) - sides.outside[which].row(i)).norm();
      if (sides.clearance(i, k) - moved < near + extra_ + surfaces_[which].margin()) {
        rows.push_back(i);
        break;
      }
    }
  return rows;
}

/// Adds the planes of obstacles and grounds for these points, and updates their last outside positions.
void ContactTerms::find_outside(const std::vector<Index>& rows, std::vector<ContactPlane>& planes) {
  ContactSides& sides = history_->sides;
  const Points now = rows_of(history_->places, rows);
  for (Index k = 0; k < sides.clearance.cols(); ++k) {
    const Vector distances = add_planes(k, rows, now, planes);
    for (Index i = 0; i < now.rows(); ++i) {
      if (distances[i] <= 0.0) continue;  // inside: keeps its last outside position
      const Index row = rows[static_cast<std::size_t>(i)];
      sides.outside[static_cast<std::size_t>(k)].row(row) = now.row(i);
      sides.clearance(row, k) = distances[i];
    }
  }
}

double ContactTerms::find(const RowMatrix<double>& coefficients, std::optional<double> extra, bool jumped) {
  if (!any()) return 0.0;
  if (!history_) begin(coefficients);
  if (known_ && !has_friction_ && !jumped && extra.value_or(0.0) <= extra_ && points_.is_at(coefficients))
    return deepest_;
  known_ = false;  // an obstacle's function may throw
  ContactHistory& history = *history_;
  points_.set_refined(history.refined);
  const Points before = std::exchange(history.places, points_.at(coefficients));
  extra_ = extra ? *extra : std::sqrt((history.places - before).rowwise().squaredNorm().maxCoeff());
  deepest_ = 0.0;
  std::vector<ContactPlane> planes;
  find_outside(near_rows(), planes);
  points_.refine(at_edges(planes, points_, surfaces_));
  if (points_.refined() != history.refined) find_outside(extend_history(coefficients), planes);
  deepest_outside_ = deepest_;
  ahead_ = false;
  if (self_) add_own_planes(coefficients, jumped, planes);
  set_planes(std::move(planes));
  known_ = true;
  return deepest_;
}

/// Adds the planes of surface k for points (rows) at positions `now`. Returns their signed distances, which
/// are negative also for points that have tunnelled through it.
Vector ContactTerms::add_planes(Index k, const std::vector<Index>& rows, PointsIn now,
                                std::vector<ContactPlane>& planes) {
  const BarrierSurface& surface = surfaces_[static_cast<std::size_t>(k)];
  ContactSides& sides = history_->sides;
  RowMatrix<double>& pressures = history_->pressures;
  const Points& outside = sides.outside[static_cast<std::size_t>(k)];
  BarrierSurface::Nearest nearest = surface.nearest(now);
  std::vector<Index> moved_rows, starts;  // points that may have crossed: rows of `now`, and of all points
  for (Index i = 0; i < now.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const double moved = (now.row(i) - outside.row(row)).norm(), clearance = sides.clearance(row, k);
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
    const bool crossed = sides.crosses(k, points_.sample_of(row));
    double margin = surface.margin() + safety_distance;
    if (crossed) margin = std::clamp(sides.clearance(row, k), 0.0, margin);  // not more than it had at first
    const double gap = nearest.distances[i] - margin;
    const bool left = sides.clearance(row, k) == ContactSides::left_inside && nearest.distances[i] < 0.0;
    if (left || gap > near + extra_) {
      pressures(row, k) = 0.0;
      continue;
    }
    deepest_ = std::max(deepest_, -gap - safety_distance);
    ContactPlane& plane = planes.emplace_back();
    plane.first = row;
    plane.normal = nearest.normals.row(i).transpose();
    plane.offset = offsets[i] + margin;
    plane.initial_gap = gap;
    plane.pressure = pressures(row, k);
    plane.area = points_.area(row);
    plane.obstacle = k;
    plane.anchor = carried.row(i).transpose();
    auto anchor = sides.anchors[static_cast<std::size_t>(k)].row(row);
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
void ContactTerms::add_own_planes(const RowMatrix<double>& coefficients, bool jumped,
                                  std::vector<ContactPlane>& planes) {
  ContactHistory& history = *history_;
  const Index own = history.pressures.cols() - 1;
  const Vector before = history.pressures.col(own);
  touches_itself_ = false;
  history.pressures.col(own).setZero();
  const auto normals = [&](auto* blocks) { return points_.normals_at(coefficients, blocks); };
  for (const FacingPair& pair :
       self_->find(samples_of(history.places), normals, std::min(near_itself + extra_, farthest), jumped,
                   history.itself)) {
    history.pressures(pair.first, own) = before[pair.first];
    deepest_ = std::max(deepest_, pair.least - safety_distance - pair.gap);
    touches_itself_ = touches_itself_ || pair.gap < pair.least - slight;
    ContactPlane& plane = planes.emplace_back();
    plane.first = pair.first;
    plane.second = pair.second;
    plane.normal = pair.normal;
    plane.offset = pair.least;
    plane.pressure = before[pair.first];
    plane.area = points_.area(pair.first);
    plane.obstacle = own;
  }
}

std::vector<SelfCrossing> ContactTerms::self_crossings(const RowMatrix<double>& coefficients,
                                                       const std::shared_ptr<const Influence>& influence) {
  if (!sees_crossings()) return {};
  const auto moved = [&](const Points& places) {
    const RadialField field(problem_.basis, coefficients, influence);
    Points result(places.rows(), 3);
    field.evaluate(places, {result.data(), result.rows(), JetOrder::value});
    return result;
  };
  return crossings_->find(*self_, samples_of(points_.at(coefficients)), moved);
}

bool ContactTerms::overlaps(const RowMatrix<double>& coefficients) {
  if (!self_crossings(coefficients).empty()) return true;
  return self_ && self_->overlaps(samples_of(points_.at(coefficients)), points_.normals_at(coefficients));
}

}  // namespace arapfields
