// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "energies/contact.h"
#include "fields/radial_evaluator.h"
#include "solve/radial/barrier_surface.h"
#include "solve/radial/problem.h"
#include "solve/radial/self_contact.h"

namespace arapfields {

/// The planes that places of a surface are kept beyond, until they are found anew.
struct ContactSet {
  std::vector<Index> samples;  ///< which of the samples that are followed
  Points places;               ///< (n,3) theirs at rest
  std::vector<ContactPlane> planes;
  Revision revision = 0;  ///< 0: no planes
};

/// Where a surface meets obstacles and itself, and how hard it presses there. What is beyond a plane is told
/// by the way that each sample took since begin(): nothing that is thinner than a step is passed.
class ContactTerms {
 public:
  explicit ContactTerms(const RadialProblem& problem) : problem_(problem) {}
  /// Throws InvalidInput for what cannot be.
  void set(const std::optional<Contact>& contact);
  /// A ground beside that of the contact; whether it is another one than before.
  bool set_further_ground(const std::optional<Ground>& ground);
  const std::optional<Contact>& contact() const { return contact_; }
  bool any() const { return !surfaces_.empty() || self_; }
  bool itself() const { return self_.has_value(); }
  bool only_itself() const { return self_ && surfaces_.empty(); }

  /// The ways start here, without pressure.
  void begin(const RowMatrix<double>& coefficients);
  /// Follows the surface, and finds the planes near it. Returns how deep a sample is beyond a margin.
  /// `further`: how much farther than usual, in cube units, what is near lies. `jumped`: the way here is not
  /// known, so that what the surface came through of itself is told by facing normals.
  double find(const RowMatrix<double>& coefficients, double further = 0.0, bool jumped = false);
  /// The largest speed of a sample, where coefficients change at these rates.
  double fastest(const RowMatrix<double>& rates);
  /// Pressures after a solve that left the places of found() there.
  void press(const double* places);
  /// No planes: the surface is free.
  void release();

  const ContactSet& found() const { return found_; }
  bool presses() const { return !found_.planes.empty(); }
  /// Forces of each surface, (surfaces, 3), on what is at a place: nearer ones count more.
  Points forces_at(const Vec3& place, const double* places) const;
  std::string name_of(Index surface) const;
  double deepest() const { return deepest_; }
  /// The same beyond obstacles and the ground alone.
  double deepest_outside() const { return deepest_outside_; }
  /// Whether parts of the surface touch as they were found.
  bool touches_itself() const { return touches_itself_; }
  /// Whether a part is inside another one there, however deep.
  bool overlaps(const RowMatrix<double>& coefficients);
  double touching() const;
  /// Of energy a unit of area for a unit of squared depth, halved.
  static constexpr double stiffness = 5e4;

 private:
  void make_surfaces();
  Vector add_planes(Index k, const std::vector<Index>& rows, PointsIn now);
  void add_own_planes(const RowMatrix<double>& coefficients, bool jumped);
  void gather_places();
  Points normals_at(const RowMatrix<double>& coefficients);
  Points places_at(const RowMatrix<double>& coefficients);

  const RadialProblem& problem_;
  std::optional<Contact> contact_;
  std::optional<Ground> further_ground_;
  std::vector<BarrierSurface> surfaces_;
  Dependent<RadialEvaluator<double>, 1> evaluator_;
  Dependent<RadialEvaluator<float>, 1> slopes_;  // of the samples, for their normals
  std::vector<Index> samples_;                   // rows of the problem's samples that are followed
  Points places_;                                // theirs at the last look
  std::optional<SelfContact> self_;
  Points seen_;                  // where they were last known outside
  RowMatrix<double> clear_;      // (samples, surfaces) no surface nearer to there
  RowMatrix<double> pressures_;  // (samples, surfaces and the shape itself)
  ContactSet found_;
  Revision sets_ = 0;  // that were found
  double deepest_ = 0.0;
  double deepest_outside_ = 0.0;
  double further_ = 0.0;
  bool touches_itself_ = false;
};

}  // namespace arapfields
