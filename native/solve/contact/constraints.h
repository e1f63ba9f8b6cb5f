// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "fields/influence.h"
#include "solve/contact/points.h"
#include "solve/contact/self_contact.h"
#include "solve/contact/sides.h"
#include "solve/contact/surface.h"
#include "solve/radial/secondary_motion.h"

namespace arapfields {

/// Contact of a surface with obstacles and itself: finds contact planes and keeps their multipliers. The path
/// of a point since begin(), relative to an obstacle, tells its side: nothing tunnels through thin obstacles.
class ContactConstraints {
 public:
  explicit ContactConstraints(const RadialProblem& problem) : problem_(problem), points_(problem) {}
  void prepare(const Progress& progress) { points_.choose(progress); }  ///< the expensive part of set()
  /// Obstacles that have moved keep their placements until move_obstacles(). Throws InvalidInput.
  void set(const std::optional<Contact>& contact, const RowMatrix<double>& coefficients);
  /// Sets a second ground, beside the contact's own; if it is another one, tracking begins anew.
  void set_second_ground(const std::optional<Ground>& ground, const RowMatrix<double>& coefficients);
  const std::optional<Contact>& contact() const { return contact_; }
  bool any() const { return !surfaces_.empty() || self_; }
  bool itself() const { return self_.has_value(); }
  bool only_itself() const { return self_ && surfaces_.empty(); }

  /// Starts tracking at this shape, with zero pressures and the obstacles at their current placements.
  void begin(const RowMatrix<double>& coefficients) { resume({}, coefficients); }
  /// The state that the next time step depends on; resume() restores it.
  ContactState state() const;
  /// Throws InvalidInput, naming `state`, for the state of other contact points or surfaces.
  void require_own(const ContactState& state) const;
  void resume(const ContactState& state, const RowMatrix<double>& coefficients);
  /// Applies a rigid change of the cube's coordinates.
  void change_coordinates(const Mat4& motion);
  /// Interpolates placements from those at resume() to the current ones. `ahead`: the surface moves later.
  void move_obstacles(double share, bool ahead = false);
  /// Upper bound of the remaining motion of a point in an obstacle's cube, in cube units.
  double longest_obstacle_motion() const;

  /// Moves the contact points and finds the contact planes near them. Returns the greatest penetration depth
  /// beyond a margin. `extra` is added to the search distance, in cube units; none: the largest
  /// motion of a point since the last search. `jumped`: the path is unknown; facing normals tell
  /// self-penetration.
  double find(const RowMatrix<double>& coefficients, std::optional<double> extra = 0.0, bool jumped = false);
  /// The state to return to after a rejected trial; there is one after find().
  ContactSnapshot snapshot() const { return {history_.value(), found_.stiffness}; }
  /// Returns to a snapshot, and finds the planes at this shape, as find() does.
  double restore(ContactSnapshot snapshot, const RowMatrix<double>& coefficients);
  /// The largest speed of a contact point for these rates of the coefficients.
  double fastest(const RowMatrix<double>& rates) {
    return std::sqrt(points_.at(rates, *history_->refined).rowwise().squaredNorm().maxCoeff());
  }
  /// Multiplier update at the positions (n,3) of found()'s points, times a factor for each surface. Returns
  /// the pressures' relative change, 0 to 1.
  double update_pressures(const double* places, const Vector& factors);
  /// Number of obstacles and grounds, and one for the shape itself.
  Index surface_count() const { return std::ssize(surfaces_) + 1; }
  /// Gives the planes Coulomb friction of their current pressures.
  void add_friction();
  void adapt_stiffness(bool raise) { found_.adapt_stiffness(raise); }
  /// Removes all planes and pressures.
  void release();
  /// Records the shape's revision at which a solve with this contact ended, and compares it.
  void end_at(Revision shape) { ended_ = shape; }
  bool ended_at(Revision shape) const { return ended_ == shape; }

  const ContactSet& found() const { return found_; }
  bool has_planes() const { return !found_.planes.empty(); }
  std::string name_of(Index surface) const;
  const std::vector<ContactSurface>& surfaces() const { return surfaces_; }  ///< obstacles and the ground
  double deepest() const { return deepest_; }
  double deepest_outside() const { return deepest_outside_; }  ///< without self-contact
  /// Whether parts of the surface touched each other at the last search.
  bool touches_itself() const { return touches_itself_; }
  std::vector<Index> crossing_surfaces() const {
    return history_ ? history_->sides.crossing_surfaces() : std::vector<Index>();
  }
  /// Where triangles of parts that are kept apart pass through each other at this shape; none without
  /// self-contact, and where samples know no mesh.
  std::vector<SelfCrossing> self_crossings(const RowMatrix<double>& coefficients,
                                           const std::shared_ptr<const Influence>& influence = nullptr);
  /// Whether there is a mesh for self_crossings().
  bool sees_crossings() const { return crossings_ && crossings_->knows_mesh(); }
  /// Whether a part is inside another one at this shape, however deep, is pressed flat, or crosses another.
  bool overlaps(const RowMatrix<double>& coefficients);

 private:
  std::vector<ContactSurface> surfaces_of(const std::optional<Contact>& contact,
                                          const std::optional<Ground>& second_ground);
  void set_surfaces(std::vector<ContactSurface> surfaces);
  void forget();
  auto samples_of(const Points& places) const { return places.topRows(points_.sample_count()); }
  Points samples_at(const RowMatrix<double>& coefficients) {
    return samples_of(points_.at(coefficients, {}));
  }
  std::vector<Index> near_rows() const;
  void find_outside(const std::vector<Index>& rows, std::vector<ContactPlane>& planes);
  Vector add_planes(Index k, const std::vector<Index>& rows, PointsIn now, std::vector<ContactPlane>& planes);
  std::vector<Index> extend_history(const ContactPoints::Refined& refined,
                                    const RowMatrix<double>& coefficients);
  void add_own_planes(const RowMatrix<double>& coefficients, bool jumped, std::vector<ContactPlane>& planes);
  void set_planes(std::vector<ContactPlane> planes);

  const RadialProblem& problem_;
  std::optional<Contact> contact_;
  std::optional<Ground> second_ground_;
  std::vector<ContactSurface> surfaces_;
  std::vector<Mat4> starts_;            // placements that move_obstacles() interpolates from
  std::vector<Mat4> ends_;              // and to
  std::vector<Mat4> obstacle_motions_;  // the motions of its last call
  ContactPoints points_;
  std::optional<SelfContact> self_;
  std::optional<SelfCrossings> crossings_;  // with self_
  std::optional<ContactHistory> history_;   // none: the next search begins anew
  ContactSet found_;
  Revision sets_ = 0;  // number of contact sets so far
  std::optional<Revision> ended_;
  double deepest_ = 0.0;
  double deepest_outside_ = 0.0;
  double extra_ = 0.0;  // the last search's `extra`
  bool touches_itself_ = false;
  bool ahead_ = false;         // obstacles have moved, and the surface has not followed yet
  bool has_friction_ = false;  // whether the planes have friction
  bool known_ = false;         // whether the last search is valid for its coefficients
};

}  // namespace arapfields
