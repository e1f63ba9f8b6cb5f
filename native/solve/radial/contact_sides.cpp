// SPDX-License-Identifier: GPL-3.0-or-later
// On which side of moving obstacles the points of a surface are, and that state between time steps.
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "solve/radial/contact_terms.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

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

ContactSides::ContactSides(Index points, std::size_t surfaces)
    : outside(surfaces),
      anchors(surfaces),
      clearance(points, static_cast<Index>(surfaces)),
      crossed(surfaces) {}

void ContactSides::start(Index surface, const BarrierSurface& obstacle, PointsIn places) {
  const auto k = static_cast<std::size_t>(surface);
  outside[k] = anchors[k] = places;
  clearance.col(surface) = obstacle.distances(places);
  crossed[k].clear();
}

void ContactTerms::require_own(const ContactState& state) const {
  require(!any() || state.points == 0 || state.points == points_.identity(), "state",
          "of the contact of other samples",
          "one that this solver, or one with the same samples, gave is needed");
}

void ContactTerms::resume(const ContactState& state, const RowMatrix<double>& coefficients) {
  require_own(state);
  forget();
  if (!any()) return;
  points_.set_refined({});
  ContactHistory next;
  next.places = points_.at(coefficients);
  next.sides = ContactSides(next.places.rows(), surfaces_.size());
  next.pressures.setZero(next.places.rows(), surface_count());
  if (self_)
    next.itself = self_->begin(samples_of(next.places),
                               [&](auto* blocks) { return points_.normals_at(coefficients, blocks); });
  const bool fits = state.placements.size() == surfaces_.size();
  for (Index k = 0; k < std::ssize(surfaces_); ++k) {
    BarrierSurface& surface = surfaces_[static_cast<std::size_t>(k)];
    surface.set_placement((fits ? state.placements : ends_)[static_cast<std::size_t>(k)]);
    next.sides.start(k, surface, next.places);
    if (!fits) next.sides.find_crossings(k, surface, points_, next.places);
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

ContactState ContactTerms::state() const {
  ContactState state;
  for (const BarrierSurface& surface : surfaces_) state.placements.push_back(surface.placement());
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

void ContactSides::move_with(Index surface, const Mat4& motion) {
  const auto k = static_cast<std::size_t>(surface);
  outside[k] = affine_image(outside[k], motion);
  anchors[k] = affine_image(anchors[k], motion);
}

void ContactSides::add(const std::vector<Index>& like) {
  const Index before = clearance.rows(), count = before + std::ssize(like);
  clearance.conservativeResize(count, Eigen::NoChange);
  clearance.bottomRows(std::ssize(like)) = clearance(like, Eigen::all).eval();
  for (std::vector<Points>* each : {&outside, &anchors})
    for (Points& places : *each) {
      places.conservativeResize(count, Eigen::NoChange);
      places.bottomRows(std::ssize(like)) = places(like, Eigen::all).eval();
    }
}

void ContactTerms::change_coordinates(const Mat4& motion) {
  for (std::size_t k = 0; k < starts_.size(); ++k) {
    starts_[k] = motion * starts_[k];
    surfaces_[k].set_placement(starts_[k]);
    if (history_) history_->sides.move_with(static_cast<Index>(k), motion);
  }
  if (history_) history_->places = affine_image(history_->places, motion);
}

/// Without a history, tracking will begin at the current placements.
void ContactTerms::move_obstacles(double share, bool ahead) {
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

double ContactTerms::longest_obstacle_motion() const {
  double longest = 0.0;
  for (std::size_t k = 0; k < starts_.size() && history_; ++k)
    longest = std::max(longest, (ends_[k] - surfaces_[k].placement()).topRows<3>().colwise().norm().sum());
  return longest;
}

/// Adds rows for points that were refined since the last search. They inherit the last outside positions of
/// their samples, or start at their own places where an obstacle crosses the surface. Returns these rows.
std::vector<Index> ContactTerms::extend_history(const RowMatrix<double>& coefficients) {
  ContactHistory next = *history_;
  std::vector<Index> rows, samples;
  for (Index row = next.places.rows(); row < points_.size(); ++row) {
    rows.push_back(row);
    samples.push_back(points_.sample_of(row));
  }
  next.refined = points_.refined();
  next.places = points_.at(coefficients);
  next.sides.add(samples);
  next.pressures.conservativeResize(points_.size(), Eigen::NoChange);
  next.pressures.bottomRows(std::ssize(rows)).setZero();
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    next.sides.begin_beside_crossings(k, surfaces_[static_cast<std::size_t>(k)], samples, next.places);
  history_ = std::move(next);
  return rows;
}

double ContactTerms::restore(ContactSnapshot snapshot, const RowMatrix<double>& coefficients) {
  history_ = std::move(snapshot.history);
  found_.stiffness = snapshot.stiffness;
  known_ = false;
  return find(coefficients);
}

}  // namespace arapfields
