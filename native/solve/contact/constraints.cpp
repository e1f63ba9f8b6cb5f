// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/constraints.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "fields/radial_field.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// Gives points whose path has entered a surface the tangent plane of the side that they entered by. `hits`
/// are those of the rows `moved_rows` of `now`; nearest normals within `reach` of that side are kept.
void go_back(const ContactSurface& surface, PointsIn now, const std::vector<Index>& moved_rows,
             const std::vector<ContactSurface::Hit>& hits, double reach, ContactSurface::Nearest& nearest,
             Vector& offsets) {
  for (std::size_t m = 0; m < moved_rows.size(); ++m) {
    const ContactSurface::Hit& hit = hits[m];
    if (hit.parameter > 1.0) continue;
    const Index i = moved_rows[m];
    const double beyond = hit.normal.dot(now.row(i).transpose() - hit.place);
    if (surface.is_sheet() && beyond < 0.0) {  // the side where the path began counts as outside
      nearest.normals.row(i) *= -1.0;
      nearest.distances[i] *= -1.0;
      offsets[i] *= -1.0;
    }
    if (nearest.distances[i] < reach &&
        nearest.normals.row(i).dot(hit.normal) >
            (surface.is_sheet() ? P::sheet_side_cosine : P::solid_side_cosine))
      continue;
    if (beyond > 0.0 && nearest.distances[i] > 0.0) continue;  // the point went around the surface
    nearest.normals.row(i) = hit.normal.transpose();
    nearest.distances[i] = beyond;
    offsets[i] = hit.normal.dot(hit.place);
  }
}

/// Makes the distances of points whose path hits the obstacle at most 0, so that they keep their side even
/// where the obstacle's edge has moved past them.
void hold_behind(const std::vector<ContactSurface::Hit>& hits, const std::vector<Index>& rows,
                 Vector& distances) {
  for (std::size_t m = 0; m < rows.size(); ++m)
    if (hits[m].parameter <= 1.0) distances[rows[m]] = std::min(0.0, distances[rows[m]]);
}

/// Samples near an edge of an obstacle, which may poke through between them and their neighbours.
std::vector<Index> at_edges(const std::vector<ContactPlane>& planes, ContactPoints& points,
                            const std::vector<ContactSurface>& surfaces) {
  std::vector<const ContactPlane*> of(static_cast<std::size_t>(points.sample_count()));
  std::vector<Index> edges;
  const double reach = P::edge_distance * points.spacing();
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
        if (beside == nullptr || beside->normal.dot(plane.normal) > P::edge_cosine) continue;
        edges.push_back(plane.first);
        break;
      }
    }
    first = last;
  }
  return edges;
}

std::vector<Mat4> placements_of(const std::vector<ContactSurface>& surfaces) {
  std::vector<Mat4> placements;
  for (const ContactSurface& surface : surfaces) placements.push_back(surface.placement());
  return placements;
}

/// Stores the points that are left inside a surface, and the last outside positions of those that have moved
/// at least by their distance from it since, and so may be inside.
void note_inside(Index k, const Points& places, const Points& outside, const Vector& clearance,
                 ContactState& state) {
  for (Index row = 0; row < places.rows(); ++row)
    if (clearance[row] == ContactSides::left_inside ||
        (clearance[row] > 0.0 && (places.row(row) - outside.row(row)).norm() >= clearance[row]))
      state.inside.push_back({row, k, outside.row(row).transpose(), clearance[row]});
}

void recall_inside(const ContactState& state, ContactSides& sides) {
  for (const ContactState::Inside& held : state.inside) {
    sides.outside[static_cast<std::size_t>(held.surface)].row(held.row) = held.outside.transpose();
    sides.clearance(held.row, held.surface) = held.clearance;
  }
}

}  // namespace

void ContactConstraints::set(const std::optional<Contact>& contact, const RowMatrix<double>& coefficients) {
  if (contact) {
    require_contact(*contact);
    require(!problem_.blend, "contact", "beside exact handles", "it needs handles that give way");
  }
  const bool goes_on = history_ && contact && contact_ && contact->itself == contact_->itself &&
                       contact->obstacles.size() == contact_->obstacles.size() &&
                       contact->ground.has_value() == contact_->ground.has_value();
  known_ = false;
  ended_.reset();
  std::vector<ContactSurface> next = surfaces_of(contact, second_ground_);
  if (!goes_on) {
    std::optional<SelfContact> self;
    std::optional<SelfCrossings> crossings;
    if (contact && contact->itself) {
      self.emplace(problem_, points_.samples(), P::safety_distance_itself);
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
  history.places = points_.at(coefficients, *history.refined);
  for (Index k = 0; k < std::ssize(next); ++k) {
    ContactSurface& surface = next[static_cast<std::size_t>(k)];
    const ContactSurface& before = surfaces_[static_cast<std::size_t>(k)];
    if (surface.has_same_function(before))
      surface.set_placement(before.placement());  // tracking continues
    else {
      history.sides.start(k, surface, history.places);
      history.sides.find_crossings(k, surface, points_, *history.refined, history.places);
    }
  }
  contact_ = contact;
  history_ = std::move(history);
  set_surfaces(std::move(next));
  ends_ = std::move(ends);
}

void ContactConstraints::set_second_ground(const std::optional<Ground>& ground,
                                           const RowMatrix<double>& coefficients) {
  if (ground == second_ground_) return;
  std::vector<ContactSurface> next = surfaces_of(contact_, ground);
  forget();
  second_ground_ = ground;
  set_surfaces(std::move(next));
  begin(coefficients);
}

/// The surfaces of a contact; chooses the contact points, if it needs any. Throws InvalidInput for what is
/// too far from the shape for the precision of places.
std::vector<ContactSurface> ContactConstraints::surfaces_of(const std::optional<Contact>& contact,
                                                            const std::optional<Ground>& second_ground) {
  std::vector<ContactSurface> surfaces;
  const Frame& frame = problem_.frame();
  const std::string allowed = "at most " + number_text(P::farthest_placed * frame.scale) +
                              " is allowed, a million times half the shape's size";
  const auto add_ground = [&](const Ground& ground) {
    const double above = ground.height - frame.center.dot(ground.up.normalized());
    require(above <= P::farthest_placed * frame.scale, "ground", number_text(above) + " above the shape",
            allowed);
    surfaces.push_back(ContactSurface::ground(ground, frame));
  };
  for (std::size_t i = 0; contact && i < contact->obstacles.size(); ++i) {
    const Obstacle& obstacle = contact->obstacles[i];
    const std::string name = "obstacles[" + std::to_string(i) + "]";
    require(obstacle.margin <= P::farthest_placed * frame.scale, name + ".margin",
            number_text(obstacle.margin), allowed);
    surfaces.emplace_back(obstacle, frame);
    const double reach = surfaces.back().placement().topRows<3>().cwiseAbs().maxCoeff();
    require(reach <= P::farthest_placed, name + ".placement",
            number_text(frame.scale * reach) + " from the shape", allowed);
  }
  if (contact && contact->ground) add_ground({*contact->ground, contact->up});
  if (second_ground) add_ground(*second_ground);
  if (!surfaces.empty() || (contact && contact->itself)) points_.choose();
  return surfaces;
}

void ContactConstraints::set_surfaces(std::vector<ContactSurface> surfaces) {
  surfaces_ = std::move(surfaces);
  starts_ = ends_ = placements_of(surfaces_);
  obstacle_motions_.assign(surfaces_.size(), Mat4::Identity());
}

/// Ends the tracking: no planes are left of it.
void ContactConstraints::forget() {
  history_.reset();
  release();
  known_ = false;
}

void ContactConstraints::release() {
  known_ = known_ && deepest_ <= 0.0 && !touches_itself_;  // then no plane is active
  found_.revision = 0;
  found_.planes.clear();
  found_.places.resize(0, 3);
  found_.embedded.resize(0, 3);
  found_.stiffness = P::softest;
  if (history_) history_->pressures.setZero();
  deepest_ = deepest_outside_ = 0.0;
  touches_itself_ = false;
}

/// Rows of points that may be within the distance threshold of a surface, by how far they have moved.
std::vector<Index> ContactConstraints::near_rows() const {
  const ContactHistory& history = *history_;
  const ContactSides& sides = history.sides;
  std::vector<Index> rows;
  for (Index i = 0; i < history.places.rows(); ++i)
    for (Index k = 0; k < sides.clearance.cols(); ++k) {
      const auto which = static_cast<std::size_t>(k);
      const double moved = (history.places.row(i) - sides.outside[which].row(i)).norm();
      if (sides.clearance(i, k) - moved < P::search_distance + extra_ + surfaces_[which].margin()) {
        rows.push_back(i);
        break;
      }
    }
  return rows;
}

/// Adds the planes of obstacles and grounds for these points, and updates their last outside positions.
void ContactConstraints::find_outside(const std::vector<Index>& rows, std::vector<ContactPlane>& planes) {
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

double ContactConstraints::find(const RowMatrix<double>& coefficients, std::optional<double> extra,
                                bool jumped) {
  if (!any()) return 0.0;
  if (!history_) begin(coefficients);
  if (known_ && !has_friction_ && !jumped && extra.value_or(0.0) <= extra_ && points_.is_at(coefficients))
    return deepest_;
  known_ = false;  // an obstacle's function may throw
  ContactHistory& history = *history_;
  const Points before = std::exchange(history.places, points_.at(coefficients, *history.refined));
  extra_ = extra ? *extra : std::sqrt((history.places - before).rowwise().squaredNorm().maxCoeff());
  deepest_ = 0.0;
  std::vector<ContactPlane> planes;
  find_outside(near_rows(), planes);
  const auto refined = points_.refine(history.refined, at_edges(planes, points_, surfaces_));
  if (refined != history.refined) find_outside(extend_history(refined, coefficients), planes);
  deepest_outside_ = deepest_;
  ahead_ = false;
  if (self_) add_own_planes(coefficients, jumped, planes);
  set_planes(std::move(planes));
  known_ = true;
  return deepest_;
}

/// Adds the planes of surface k for points (rows) at positions `now`. Returns their signed distances, which
/// are negative also for points that have tunnelled through it.
Vector ContactConstraints::add_planes(Index k, const std::vector<Index>& rows, PointsIn now,
                                      std::vector<ContactPlane>& planes) {
  const ContactSurface& surface = surfaces_[static_cast<std::size_t>(k)];
  ContactSides& sides = history_->sides;
  RowMatrix<double>& pressures = history_->pressures;
  const Points& outside = sides.outside[static_cast<std::size_t>(k)];
  ContactSurface::Nearest nearest = surface.nearest(now);
  std::vector<Index> moved_rows, starts;  // points that may have crossed: rows of `now`, and of all points
  for (Index i = 0; i < now.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const double moved = (now.row(i) - outside.row(row)).norm(), clearance = sides.clearance(row, k);
    if (clearance > 0.0 && moved > clearance + std::max(0.0, nearest.distances[i]) - P::path_error)
      moved_rows.push_back(i), starts.push_back(row);
  }
  const std::vector<ContactSurface::Hit> hits =
      surface.first_hits(rows_of(outside, starts), rows_of(now, moved_rows));
  Vector offsets(now.rows());
  for (Index i = 0; i < now.rows(); ++i)
    offsets[i] = nearest.normals.row(i).dot(now.row(i)) - nearest.distances[i];
  go_back(surface, now, moved_rows, hits, P::search_distance + extra_, nearest, offsets);
  const Points carried = affine_image(now, obstacle_motions_[static_cast<std::size_t>(k)]);
  for (Index i = 0; i < now.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const bool crossed = sides.crosses(k, points_.sample_of(row, *history_->refined));
    double margin = surface.margin() + P::safety_distance;
    if (crossed) margin = std::clamp(sides.clearance(row, k), 0.0, margin);  // not more than it had at first
    const double gap = nearest.distances[i] - margin;
    const bool left = sides.clearance(row, k) == ContactSides::left_inside && nearest.distances[i] < 0.0;
    if (left || gap > P::search_distance + extra_) {
      pressures(row, k) = 0.0;
      continue;
    }
    deepest_ = std::max(deepest_, -gap - P::safety_distance);
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
      plane.anchor -= std::min(1.0, P::stuck / slip.norm()) * slip;
    }
    anchor = plane.anchor.transpose();
  }
  if (ahead_) hold_behind(hits, moved_rows, nearest.distances);
  return nearest.distances;
}

/// Adds the planes of self-contact.
void ContactConstraints::add_own_planes(const RowMatrix<double>& coefficients, bool jumped,
                                        std::vector<ContactPlane>& planes) {
  ContactHistory& history = *history_;
  const Index own = history.pressures.cols() - 1;
  const Vector before = history.pressures.col(own);
  touches_itself_ = false;
  history.pressures.col(own).setZero();
  const auto normals = [&](auto* blocks) { return points_.normals_at(coefficients, blocks); };
  for (const FacingPair& pair : self_->find(samples_of(history.places), normals,
                                            std::min(P::search_distance_itself + extra_, P::farthest_itself),
                                            jumped, history.itself)) {
    history.pressures(pair.first, own) = before[pair.first];
    deepest_ = std::max(deepest_, pair.least - P::safety_distance - pair.gap);
    touches_itself_ = touches_itself_ || pair.gap < pair.least - P::touching_gap;
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

std::vector<SelfCrossing> ContactConstraints::self_crossings(
    const RowMatrix<double>& coefficients, const std::shared_ptr<const Influence>& influence) {
  if (!sees_crossings()) return {};
  const auto moved = [&](const Points& places) {
    const RadialField field(problem_.basis, coefficients, influence);
    Points result(places.rows(), 3);
    field.evaluate(places, {result.data(), result.rows(), JetOrder::value});
    return result;
  };
  return crossings_->find(*self_, samples_at(coefficients), moved);
}

bool ContactConstraints::overlaps(const RowMatrix<double>& coefficients) {
  if (!self_crossings(coefficients).empty()) return true;
  return self_ && self_->overlaps(samples_at(coefficients), points_.normals_at(coefficients));
}

void ContactConstraints::require_own(const ContactState& state) const {
  require(!any() || state.points == 0 || state.points == points_.identity(), "state",
          "of the contact of other samples",
          "one that this solver, or one with the same samples, gave is needed");
}

void ContactConstraints::resume(const ContactState& state, const RowMatrix<double>& coefficients) {
  require_own(state);
  forget();
  if (!any()) return;
  ContactHistory next;
  next.places = points_.at(coefficients, *next.refined);
  next.sides = ContactSides(next.places.rows(), surfaces_.size());
  next.pressures.setZero(next.places.rows(), surface_count());
  if (self_)
    next.itself = self_->begin(samples_of(next.places),
                               [&](auto* blocks) { return points_.normals_at(coefficients, blocks); });
  const bool fits = state.placements.size() == surfaces_.size();
  for (Index k = 0; k < std::ssize(surfaces_); ++k) {
    ContactSurface& surface = surfaces_[static_cast<std::size_t>(k)];
    surface.set_placement((fits ? state.placements : ends_)[static_cast<std::size_t>(k)]);
    next.sides.start(k, surface, next.places);
    if (!fits) next.sides.find_crossings(k, surface, points_, *next.refined, next.places);
  }
  if (fits && state.points != 0) {
    recall_inside(state, next.sides);
    next.sides.crossed = state.crossed;
    for (const ContactState::Pressure& held : state.pressures) {
      next.pressures(held.row, held.surface) = held.pressure;
      if (held.surface < std::ssize(surfaces_))
        next.sides.anchors[static_cast<std::size_t>(held.surface)].row(held.row) = held.anchor.transpose();
    }
  }
  starts_ = fits ? state.placements : ends_;
  obstacle_motions_.assign(surfaces_.size(), Mat4::Identity());
  history_ = std::move(next);
}

ContactState ContactConstraints::state() const {
  ContactState state;
  for (const ContactSurface& surface : surfaces_) state.placements.push_back(surface.placement());
  if (!history_) return state;
  const ContactHistory& history = *history_;
  const Index count = points_.coarse_count();
  state.points = points_.identity();
  for (Index row = 0; row < count; ++row)
    for (Index k = 0; k < history.pressures.cols(); ++k)
      if (history.pressures(row, k) > 0.0) {
        const Points& of =
            k < std::ssize(surfaces_) ? history.sides.anchors[static_cast<std::size_t>(k)] : history.places;
        state.pressures.push_back({row, k, history.pressures(row, k), of.row(row).transpose()});
      }
  state.crossed = history.sides.crossed;
  const Points places = history.places.topRows(count);
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    note_inside(k, places, history.sides.outside[static_cast<std::size_t>(k)], history.sides.clearance.col(k),
                state);
  return state;
}

void ContactConstraints::change_coordinates(const Mat4& motion) {
  for (std::size_t k = 0; k < starts_.size(); ++k) {
    starts_[k] = motion * starts_[k];
    surfaces_[k].set_placement(starts_[k]);
    if (history_) history_->sides.move_with(static_cast<Index>(k), motion);
  }
  if (history_) history_->places = affine_image(history_->places, motion);
}

/// Without a history, tracking will begin at the current placements.
void ContactConstraints::move_obstacles(double share, bool ahead) {
  if (!history_) return;
  for (Index k = 0; k < std::ssize(starts_); ++k) {
    const auto which = static_cast<std::size_t>(k);
    obstacle_motions_[which].setIdentity();
    if (surfaces_[which].placement() == ends_[which]) continue;
    known_ = false;
    ahead_ = ahead;
    const Mat4 before = surfaces_[which].placement();
    if (share < 1.0)
      surfaces_[which].place_between(starts_[which], ends_[which], share);
    else
      surfaces_[which].set_placement(ends_[which]);
    obstacle_motions_[which] = surfaces_[which].placement() * before.inverse();
    history_->sides.move_with(k, obstacle_motions_[which]);
  }
}

double ContactConstraints::longest_obstacle_motion() const {
  double longest = 0.0;
  for (std::size_t k = 0; k < starts_.size() && history_; ++k)
    longest = std::max(longest, (ends_[k] - surfaces_[k].placement()).topRows<3>().colwise().norm().sum());
  return longest;
}

/// Adds rows for points that were refined since the last search. They inherit the last outside positions of
/// their samples, or start at their own places where an obstacle crosses the surface. Returns these rows.
std::vector<Index> ContactConstraints::extend_history(const ContactPoints::Refined& refined,
                                                      const RowMatrix<double>& coefficients) {
  ContactHistory next = *history_;
  std::vector<Index> rows, samples;
  for (Index row = next.places.rows(); row < points_.size(*refined); ++row) {
    rows.push_back(row);
    samples.push_back(points_.sample_of(row, *refined));
  }
  next.refined = refined;
  next.places = points_.at(coefficients, *refined);
  next.sides.add(samples);
  next.pressures.conservativeResize(next.places.rows(), Eigen::NoChange);
  next.pressures.bottomRows(std::ssize(rows)).setZero();
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    next.sides.begin_beside_crossings(k, surfaces_[static_cast<std::size_t>(k)], samples, next.places);
  history_ = std::move(next);
  return rows;
}

double ContactConstraints::restore(ContactSnapshot snapshot, const RowMatrix<double>& coefficients) {
  history_ = std::move(snapshot.history);
  found_.stiffness = snapshot.stiffness;
  known_ = false;
  return find(coefficients);
}

/// Replaces the planes. Collects their points, once each, and lets the planes index them.
void ContactConstraints::set_planes(std::vector<ContactPlane> planes) {
  const RefinedPoints& refined = *history_->refined;
  std::vector<Index> place(static_cast<std::size_t>(points_.size(refined)), -1);
  const auto of = [&](Index row) -> Index& { return place[static_cast<std::size_t>(row)]; };
  for (const ContactPlane& plane : planes)
    for (const Index row : {plane.first, plane.second})
      if (row >= 0) of(row) = 0;
  std::vector<Index> rows;
  for (Index row = 0; row < points_.size(refined); ++row) {
    if (of(row) < 0) continue;
    of(row) = std::ssize(rows);
    rows.push_back(row);
  }
  found_.samples.clear();
  for (const Index row : rows)
    found_.samples.push_back(points_.samples()[static_cast<std::size_t>(points_.sample_of(row, refined))]);
  found_.places = points_.rest(rows, refined);
  found_.embedded = points_.embedded(rows, refined);
  for (ContactPlane& plane : planes) {
    plane.first = of(plane.first);
    if (plane.second >= 0) plane.second = of(plane.second);
  }
  found_.rows = std::move(rows);
  found_.planes = std::move(planes);
  found_.revision = found_.planes.empty() ? 0 : ++sets_;
  has_friction_ = false;
}

std::string ContactConstraints::name_of(Index surface) const {
  if (contact_ && surface < std::ssize(contact_->obstacles))
    return "obstacles[" + std::to_string(surface) + "]";
  return surface < std::ssize(surfaces_) ? "ground" : "itself";
}

double ContactConstraints::update_pressures(const double* places, const Vector& factors) {
  double change = 0.0, most = 0.0;
  for (ContactPlane& plane : found_.planes) {
    const double before = plane.pressure;
    const double gap = std::max(-P::deepest_counted, plane.gap(places));
    plane.pressure = factors[plane.obstacle] * plane.updated_pressure(gap, found_.stiffness);
    history_->pressures(found_.rows[static_cast<std::size_t>(plane.first)], plane.obstacle) = plane.pressure;
    change += plane.area * std::abs(plane.pressure - before);
    most += plane.area * std::max(plane.pressure, before);
  }
  if (has_friction_) add_friction();
  return most > 0.0 ? change / most : 0.0;
}

void ContactConstraints::add_friction() {
  has_friction_ = true;
  const double coefficient = contact_ ? contact_->friction : Contact().friction;
  for (ContactPlane& plane : found_.planes)
    if (plane.second < 0) plane.friction = coefficient * plane.pressure;
}

}  // namespace arapfields
