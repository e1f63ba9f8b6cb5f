// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "energies/handles.h"
#include "fields/influence.h"
#include "solve/radial/part_links.h"

namespace arapfields {

/// Pairs of places that pull at a field: those of handles, and of what lies beyond their reach. Without
/// handles, the lowest sample alone is held. With a symmetry, each pair's reflection as well.
class HandleTerms {
 public:
  explicit HandleTerms(const RadialProblem& problem) : problem_(problem) {}
  /// Handles in mesh coordinates. Throws InvalidInput that names the handle which does not fit.
  void set(const std::vector<Handle>& handles);
  void set_targets(const std::vector<Handle>& moved);
  /// Where a figure's head is: without handles, what lies lowest against it is held.
  void set_up(const Vec3& up);

  bool any() const { return !handles_.empty(); }
  const std::vector<Handle>& handles() const { return handles_; }
  const BoundHandles& bound() const { return bound_; }
  const HandleBatch<double>& pairs() const { return pairs_; }
  /// The first of the pairs, which are the handles' own; without handles all of them.
  Index own_count() const { return any() ? static_cast<Index>(rows_.size()) : pairs_.sources.rows(); }
  /// Which handle each of its own pairs is of.
  Index handle_of(Index pair) const;
  /// The pairs' targets where the handles have moved so.
  Points targets_at(const std::vector<Mat4>& motions) const;
  /// How far the motion reaches; null: everywhere.
  const std::shared_ptr<const Influence>& influence() const { return influence_; }
  /// Values of the basis functions (pairs, size) at the pairs' sources.
  const RowMatrix<double>& basis_values();
  /// Of parts of the surface that no pair is in.
  const PartLinks& links();
  /// Of the pairs' sources and weights; targets move without it.
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
  std::shared_ptr<const Influence> influence_;  // these, unless a handle without a reach has moved
  std::vector<Index> rows_;                     // rows of bound_ that pull
  Points held_;                                 // samples beyond the influence, which are held in place
  HandleBatch<double> pairs_;
  Dependent<RowMatrix<double>, 1> basis_values_;
  Dependent<PartLinks, 1> links_;
  Revision revision_ = 0;
};

}  // namespace arapfields
