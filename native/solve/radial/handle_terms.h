// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "energies/handles.h"
#include "fields/influence.h"
#include "solve/radial/part_links.h"

namespace arapfields {

/// The source–target pairs of the handle energy Σ weight ‖f(source) − target‖²: of handles, and fixed samples
/// beyond their reach. Without handles, the lowest sample alone is fixed. With a symmetry, each pair has its
/// reflection.
class HandleTerms {
 public:
  explicit HandleTerms(const RadialProblem& problem) : problem_(problem) {}
  /// Handles in mesh coordinates. Throws InvalidInput that names the handle which does not fit.
  void set(const std::vector<Handle>& handles);
  void set_targets(const std::vector<Handle>& moved);
  /// The upward direction that defines the lowest sample.
  void set_up(const Vec3& up);
  const Vec3& up() const { return up_; }
  /// Without handles: holds the lowest sample at that place, in cube coordinates, or where it is at rest.
  void move_anchor(const Vec3& place);
  void rest_anchor();

  bool any() const { return !handles_.empty(); }
  const std::vector<Handle>& handles() const { return handles_; }
  const BoundHandles& bound() const { return bound_; }
  const HandleBatch<double>& pairs() const { return pairs_; }
  /// Number of the handles' own pairs, which come first; without handles, of all pairs.
  Index own_count() const { return any() ? static_cast<Index>(rows_.size()) : pairs_.sources.rows(); }
  /// The handle of one of these pairs.
  Index handle_of(Index pair) const;
  /// The pairs' targets for these motions of the handles.
  Points targets_at(const std::vector<Mat4>& motions) const;
  /// Limit of the deformation to the handles' reach; null: none.
  const std::shared_ptr<const Influence>& influence() const { return influence_; }
  /// Values of the basis functions (pairs, size) at the pairs' sources.
  const RowMatrix<double>& basis_values();
  /// Links of the parts of the surface without pairs.
  const PartLinks& links();
  /// Revision of the pairs' sources and weights, not of the targets.
  Revision revision() const { return revision_; }

 private:
  std::shared_ptr<const Influence> reaches() const;
  bool update_influence();
  void choose_pairs();
  void choose_anchor();
  void reflect_pairs();
  Points with_reflections(Points targets) const;

  const RadialProblem& problem_;
  std::vector<Handle> handles_;  // mesh coordinates
  BoundHandles bound_;
  Vec3 up_ = Vec3::UnitZ();
  std::shared_ptr<const Influence> reaches_;    // of handles that have a reach; null: none has
  std::shared_ptr<const Influence> influence_;  // reaches_, or null if a handle without a reach has moved
  std::vector<Index> rows_;                     // rows of bound_ that are pairs
  Points held_;                                 // fixed samples beyond the influence
  HandleBatch<double> pairs_;
  Dependent<RowMatrix<double>, 1> basis_values_;
  Dependent<PartLinks, 1> links_;
  Revision revision_ = 0;
};

}  // namespace arapfields
