// SPDX-License-Identifier: GPL-3.0-or-later
// On which side of moving obstacles the points of a surface are, and that state between time steps.
#include <cmath>
#include <utility>

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

void recall_inside(const ContactState& state, std::vector<Points>& outside, RowMatrix<double>& clearance) {
  for (const ContactState::Inside& held : state.inside)
    if (held.row < clearance.rows() && held.surface < clearance.cols()) {
      outside[static_cast<std::size_t>(held.surface)].row(held.row) = held.outside.transpose();
      clearance(held.row, held.surface) = held.clearance;
    }
}

}  // namespace

void ContactTerms::resume(const ContactState& state, const RowMatrix<double>& coefficients) {
  sides_ = {};
  if (!any()) return release();
  points_.coarsen();
  places_ = points_.at(coefficients);
  if (self_) self_->begin(places_, [&](auto* blocks) { return points_.normals_at(coefficients, blocks); });
  const Index count = std::ssize(surfaces_);
  const bool fits = std::ssize(state.placements) == count;
  sides_.outside.resize(surfaces_.size());
  sides_.anchors.resize(surfaces_.size());
  sides_.crossed.resize(surfaces_.size());
  sides_.clearance.resize(places_.rows(), count);
  pressures_.resize(places_.rows(), count + 1);
  for (Index k = 0; k < count; ++k) {
    const auto which = static_cast<std::size_t>(k);
    surfaces_[which].set_placement(fits ? state.placements[which] : ends_[which]);
    start_tracking(k);
    if (!fits) sides_.find_crossings(k, surfaces_[which], points_, places_);
  }
  if (fits) {
    recall_inside(state, sides_.outside, sides_.clearance);
    sides_.crossed = state.crossed;
    sides_.crossed.resize(surfaces_.size());
  }
  starts_ = fits ? state.placements : ends_;
  obstacle_motions_.assign(surfaces_.size(), Mat4::Identity());
  release();
  known_ = false;
  for (const ContactState::Pressure& held : state.pressures)
    if (held.row < pressures_.rows() && held.surface < pressures_.cols()) {
      pressures_(held.row, held.surface) = held.pressure;
      if (held.surface < count)
        sides_.anchors[static_cast<std::size_t>(held.surface)].row(held.row) = held.anchor.transpose();
    }
}

/// Starts the tracking of a surface's sides at the current places.
void ContactTerms::start_tracking(Index k) {
  sides_.outside[static_cast<std::size_t>(k)] = sides_.anchors[static_cast<std::size_t>(k)] = places_;
  sides_.clearance.col(k) = surfaces_[static_cast<std::size_t>(k)].distances(places_);
}

ContactState ContactTerms::state() const {
  ContactState state;
  for (const BarrierSurface& surface : surfaces_) state.placements.push_back(surface.placement());
  for (Index row = 0; row < std::min<Index>(pressures_.rows(), points_.coarse_count()); ++row)
    for (Index k = 0; k < pressures_.cols(); ++k)
      if (pressures_(row, k) > 0.0) {
        const Points& of =
            k < std::ssize(sides_.anchors) ? sides_.anchors[static_cast<std::size_t>(k)] : places_;
        state.pressures.push_back({row, k, pressures_(row, k), of.row(row).transpose()});
      }
  state.crossed = sides_.crossed;
  const Points places = places_.topRows(std::min<Index>(places_.rows(), points_.coarse_count()));
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    note_inside(k, places, sides_.outside[static_cast<std::size_t>(k)], sides_.clearance.col(k), state);
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
    sides_.move_with(static_cast<Index>(k), motion);
  }
  places_ = affine_image(places_, motion);
}

void ContactTerms::move_obstacles(double share, bool ahead) {
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
    sides_.move_with(k, obstacle_motions_[which]);
  }
}

double ContactTerms::longest_obstacle_motion() const {
  double longest = 0.0;
  for (std::size_t k = 0; k < starts_.size(); ++k)
    longest = std::max(longest, (ends_[k] - surfaces_[k].placement()).topRows<3>().colwise().norm().sum());
  return longest;
}

/// Refined points inherit the last outside positions of their samples, or start at their own places where an
/// obstacle crosses the surface.
void ContactTerms::extend_sides() {
  std::vector<Index> samples;
  for (Index i = sides_.clearance.rows(); i < points_.size(); ++i) samples.push_back(points_.sample_of(i));
  sides_.add(samples);
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    sides_.begin_beside_crossings(k, surfaces_[static_cast<std::size_t>(k)], samples, places_);
}

ContactSides ContactTerms::sides() const {
  ContactSides sides = sides_;
  if (self_) sides.itself = self_->last_search();
  return sides;
}

void ContactTerms::set_sides(ContactSides sides) {
  if (self_) self_->set_last_search(std::move(sides.itself));
  sides_ = std::move(sides);
  known_ = false;
  extend_sides();
}

void ContactTerms::restore(ContactSnapshot snapshot) {
  set_sides(std::move(snapshot.sides));
  pressures_.setZero();
  pressures_.topRows(snapshot.pressures.rows()) = snapshot.pressures;
  found_.stiffness = snapshot.stiffness;
}

}  // namespace arapfields
