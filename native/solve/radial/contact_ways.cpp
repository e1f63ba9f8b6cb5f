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
void note_inside(Index k, const Points& places, const Points& seen, const Vector& clear,
                 ContactState& state) {
  for (Index row = 0; row < places.rows(); ++row)
    if (clear[row] == ContactWays::left_inside ||
        (clear[row] > 0.0 && (places.row(row) - seen.row(row)).norm() >= clear[row]))
      state.inside.push_back({row, k, seen.row(row).transpose(), clear[row]});
}

void recall_inside(const ContactState& state, std::vector<Points>& seen, RowMatrix<double>& clear) {
  for (const ContactState::Inside& held : state.inside)
    if (held.row < clear.rows() && held.surface < clear.cols()) {
      seen[static_cast<std::size_t>(held.surface)].row(held.row) = held.seen.transpose();
      clear(held.row, held.surface) = held.clear;
    }
}

}  // namespace

void ContactTerms::resume(const ContactState& state, const RowMatrix<double>& coefficients) {
  ways_ = {};
  if (!any()) return release();
  points_.coarsen();
  places_ = points_.at(coefficients);
  if (self_) self_->begin(places_, [&](auto* blocks) { return points_.normals_at(coefficients, blocks); });
  const Index count = std::ssize(surfaces_);
  const bool fits = std::ssize(state.placements) == count;
  ways_.seen.resize(surfaces_.size());
  ways_.anchors.resize(surfaces_.size());
  ways_.crossed.resize(surfaces_.size());
  ways_.clear.resize(places_.rows(), count);
  pressures_.resize(places_.rows(), count + 1);
  for (Index k = 0; k < count; ++k) {
    const auto which = static_cast<std::size_t>(k);
    surfaces_[which].set_placement(fits ? state.placements[which] : ends_[which]);
    see(k);
    if (!fits) ways_.cross(k, surfaces_[which], points_, places_);
  }
  if (fits) {
    recall_inside(state, ways_.seen, ways_.clear);
    ways_.crossed = state.crossed;
    ways_.crossed.resize(surfaces_.size());
  }
  starts_ = fits ? state.placements : ends_;
  carried_.assign(surfaces_.size(), Mat4::Identity());
  release();
  known_ = false;
  for (const ContactState::Pressure& held : state.pressures)
    if (held.row < pressures_.rows() && held.surface < pressures_.cols()) {
      pressures_(held.row, held.surface) = held.pressure;
      if (held.surface < count)
        ways_.anchors[static_cast<std::size_t>(held.surface)].row(held.row) = held.anchor.transpose();
    }
}

/// Starts the tracking of a surface's sides at the current places.
void ContactTerms::see(Index k) {
  ways_.seen[static_cast<std::size_t>(k)] = ways_.anchors[static_cast<std::size_t>(k)] = places_;
  ways_.clear.col(k) = surfaces_[static_cast<std::size_t>(k)].distances(places_);
}

ContactState ContactTerms::held() const {
  ContactState state;
  for (const BarrierSurface& surface : surfaces_) state.placements.push_back(surface.placement());
  for (Index row = 0; row < std::min<Index>(pressures_.rows(), points_.coarse_count()); ++row)
    for (Index k = 0; k < pressures_.cols(); ++k)
      if (pressures_(row, k) > 0.0) {
        const Points& of =
            k < std::ssize(ways_.anchors) ? ways_.anchors[static_cast<std::size_t>(k)] : places_;
        state.pressures.push_back({row, k, pressures_(row, k), of.row(row).transpose()});
      }
  state.crossed = ways_.crossed;
  const Points places = places_.topRows(std::min<Index>(places_.rows(), points_.coarse_count()));
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    note_inside(k, places, ways_.seen[static_cast<std::size_t>(k)], ways_.clear.col(k), state);
  return state;
}

void ContactWays::carry(Index surface, const Mat4& motion) {
  const auto k = static_cast<std::size_t>(surface);
  seen[k] = affine_image(seen[k], motion);
  anchors[k] = affine_image(anchors[k], motion);
}

void ContactWays::add(const std::vector<Index>& like) {
  const Index before = clear.rows(), count = before + std::ssize(like);
  clear.conservativeResize(count, Eigen::NoChange);
  clear.bottomRows(std::ssize(like)) = clear(like, Eigen::all).eval();
  for (std::vector<Points>* each : {&seen, &anchors})
    for (Points& places : *each) {
      places.conservativeResize(count, Eigen::NoChange);
      places.bottomRows(std::ssize(like)) = places(like, Eigen::all).eval();
    }
}

void ContactTerms::change_coordinates(const Mat4& motion) {
  for (std::size_t k = 0; k < starts_.size(); ++k) {
    starts_[k] = motion * starts_[k];
    surfaces_[k].set_placement(starts_[k]);
    ways_.carry(static_cast<Index>(k), motion);
  }
  places_ = affine_image(places_, motion);
}

void ContactTerms::move_obstacles(double share, bool ahead) {
  for (Index k = 0; k < std::ssize(starts_); ++k) {
    const auto which = static_cast<std::size_t>(k);
    carried_[which].setIdentity();
    if (surfaces_[which].placement() == ends_[which]) continue;
    known_ = false;
    ahead_ = ahead;
    const Mat4 before = surfaces_[which].placement();
    if (share < 1.0)
      surfaces_[which].place_between(starts_[which], ends_[which], share);
    else
      surfaces_[which].set_placement(ends_[which]);
    carried_[which] = surfaces_[which].placement() * before.inverse();
    ways_.carry(k, carried_[which]);
  }
}

double ContactTerms::obstacle_way() const {
  double way = 0.0;
  for (std::size_t k = 0; k < starts_.size(); ++k)
    way = std::max(way, (ends_[k] - surfaces_[k].placement()).topRows<3>().colwise().norm().sum());
  return way;
}

/// Refined points inherit the last outside positions of their samples, or start at their own places where an
/// obstacle crosses the surface.
void ContactTerms::add_finer_ways() {
  std::vector<Index> samples;
  for (Index row = ways_.clear.rows(); row < points_.size(); ++row) samples.push_back(points_.sample_of(row));
  ways_.add(samples);
  for (Index k = 0; k < std::ssize(surfaces_); ++k)
    ways_.begin_beside_crossings(k, surfaces_[static_cast<std::size_t>(k)], samples, places_);
}

ContactWays ContactTerms::ways() const {
  ContactWays ways = ways_;
  if (self_) ways.own = self_->ways();
  return ways;
}

void ContactTerms::set_ways(ContactWays ways) {
  if (self_) self_->set_ways(std::move(ways.own));
  ways_ = std::move(ways);
  known_ = false;
  add_finer_ways();
}

void ContactTerms::set_pressing(ContactPressing pressing) {
  set_ways(std::move(pressing.ways));
  pressures_.setZero();
  pressures_.topRows(pressing.pressures.rows()) = pressing.pressures;
  found_.stiffness = pressing.stiffness;
}

}  // namespace arapfields
