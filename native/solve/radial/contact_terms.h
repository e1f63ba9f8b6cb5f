// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "solve/radial/barrier_surface.h"
#include "solve/radial/contact_points.h"
#include "solve/radial/contact_ways.h"
#include "solve/radial/secondary_motion.h"

namespace arapfields {

/// Where a surface meets obstacles and itself, and how hard it presses. What is beyond a plane is told by the
/// ways of places since begin(), relative to the obstacle: nothing that is thinner than a step is passed.
class ContactTerms {
 public:
  /// Distance beyond each margin, in cube units: what solves leave of a depth is within.
  static constexpr double kept = 1.5e-3;
  explicit ContactTerms(const RadialProblem& problem) : problem_(problem), points_(problem) {}
  void prepare(const Progress& progress) { points_.choose(progress); }  ///< what takes long of set()
  /// Obstacles that only move or change stay where they were until move_obstacles(). Throws InvalidInput.
  void set(const std::optional<Contact>& contact, const RowMatrix<double>& coefficients);
  /// A ground beside that of the contact; whether it is another one than before.
  bool set_further_ground(const std::optional<Ground>& ground);
  const std::optional<Contact>& contact() const { return contact_; }
  bool any() const { return !surfaces_.empty() || self_; }
  bool itself() const { return self_.has_value(); }
  bool only_itself() const { return self_ && surfaces_.empty(); }

  /// The ways start here, without pressure, and obstacles are where they belong.
  void begin(const RowMatrix<double>& coefficients) { resume({}, coefficients); }
  /// What the next step depends on; begins there with it.
  ContactState held() const;
  void resume(const ContactState& state, const RowMatrix<double>& coefficients);
  /// The coordinates of the cube have moved rigidly.
  void change_coordinates(const Mat4& motion);
  /// Takes the obstacles a share of the way from where resume() had them. `ahead`: the surface follows later.
  void move_obstacles(double share, bool ahead = false);
  /// The longest way left for a place of an obstacle's cube, in cube units.
  double obstacle_way() const;

  /// Follows the surface, and finds the planes near it. Returns how deep a place is beyond a margin.
  /// `further`: what is near lies so much farther than usual, in cube units; none: as far as the surface has
  /// moved since the last search. `jumped`: by an unknown way; facing normals tell what it came through.
  double find(const RowMatrix<double>& coefficients, std::optional<double> further = 0.0,
              bool jumped = false);
  ContactWays ways() const;
  /// Takes back all searches since these were the ways.
  void set_ways(ContactWays ways);
  /// What it goes on with after a look elsewhere.
  ContactPressing pressing() const { return {ways(), pressures_, found_.stiffness}; }
  void set_pressing(ContactPressing pressing);
  /// The largest speed of a sample, where coefficients change at these rates.
  double fastest(const RowMatrix<double>& rates) {
    return std::sqrt(points_.at(rates).rowwise().squaredNorm().maxCoeff());
  }
  /// Pressures after a solve that left the places of found() there, times a share of each surface. Returns
  /// how much of them has changed, 0 to 1.
  double press(const double* places, const Vector& shares);
  /// Obstacles, the ground and the shape itself.
  Index surface_count() const { return pressures_.cols(); }
  /// Friction holds what was found, as hard as it presses.
  void grip();
  void harden(bool more) { found_.harden(more); }
  /// No planes: the surface is free.
  void release();
  /// A solve with this contact left the shape at that revision; whether it did.
  void end_at(Revision shape) { ended_ = shape; }
  bool ended_at(Revision shape) const { return ended_ == shape; }

  const ContactSet& found() const { return found_; }
  Index sample_of(Index place) const;  ///< of the problem's, that a found place is of
  bool presses() const { return !found_.planes.empty(); }
  std::string name_of(Index surface) const;
  const std::vector<BarrierSurface>& surfaces() const { return surfaces_; }  ///< obstacles and the ground
  double deepest() const { return deepest_; }
  double deepest_outside() const { return deepest_outside_; }  ///< beyond obstacles and the ground alone
  /// Whether parts of the surface touch as they were found.
  bool touches_itself() const { return touches_itself_; }
  std::vector<Index> crossing() const { return ways_.crossing(); }  ///< surfaces that places stay inside of
  /// Whether a part is inside another one there, however deep.
  bool overlaps(const RowMatrix<double>& coefficients);

 private:
  void gather_surfaces();
  void see(Index k);
  std::vector<Index> near_rows() const;
  void find_outside(const std::vector<Index>& rows);
  Vector add_planes(Index k, const std::vector<Index>& rows, PointsIn now);
  void add_finer_ways();
  void add_own_planes(const RowMatrix<double>& coefficients, bool jumped);
  void gather_places();

  const RadialProblem& problem_;
  std::optional<Contact> contact_;
  std::optional<Ground> further_ground_;
  std::vector<BarrierSurface> surfaces_;
  std::vector<Mat4> starts_;   // placements that they move from
  std::vector<Mat4> ends_;     // and to
  std::vector<Mat4> carried_;  // their last moves
  ContactPoints points_;
  Points places_;  // at the last look
  std::optional<SelfContact> self_;
  ContactWays ways_;
  RowMatrix<double> pressures_;  // (places, surfaces and the shape itself)
  ContactSet found_;
  Revision sets_ = 0;  // that were found
  std::optional<Revision> ended_;
  double deepest_ = 0.0;
  double deepest_outside_ = 0.0;
  double further_ = 0.0;
  bool touches_itself_ = false;
  bool ahead_ = false;  // obstacles have moved, and the surface follows later
  bool grips_ = false;  // what was found last
  bool known_ = false;  // nothing but the coefficients has changed since
};

}  // namespace arapfields
