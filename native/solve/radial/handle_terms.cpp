// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/handle_terms.h"

#include "core/random.h"
#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "solve/radial/handle_motion.h"
#include "solve/setup.h"
#include "solve/warnings.h"

namespace arapfields {
namespace {

/// Weight, relative to the surface's energy, of the fixed lowest sample of a style without handles.
constexpr double anchor_weight = 1.0;

/// Motion, in cube units, up to which a handle without a reach counts as an anchor.
constexpr double hardly_moved = 1e-4;
/// Spacing, as a fraction of the reach, of the points of a handle that distances are measured from, and their
/// largest number.
constexpr double place_spacing = 0.25;
constexpr Index most_places = 256;

}  // namespace

void HandleTerms::set(const std::vector<Handle>& handles) {
  bound_ = bound_handles(handles, problem_.samples);
  require_within_reach(bound_, problem_.surface());
  handles_ = handles;
  reaches_ = reaches();
  update_influence();
  choose_pairs();
}

void HandleTerms::set_targets(const std::vector<Handle>& moved) {
  bound_.retarget(in_cube(moved, problem_.frame()));
  require_within_reach(bound_, problem_.surface());
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    handles_[i].target = moved[i].target;
    handles_[i].target_point = moved[i].target_point;
  }
  if (!any()) return;
  if (update_influence()) return choose_pairs();
  Points targets(own_count() + held_.rows(), 3);
  targets << rows_of(bound_.targets(), rows_), held_;
  pairs_.targets = with_reflections(std::move(targets));
}

void HandleTerms::set_up(const Vec3& up) {
  const bool changed = up != up_;
  up_ = up;
  if (changed && !any()) choose_pairs();
}

void HandleTerms::choose_pairs() {
  ++revision_;
  rows_.clear();
  held_.resize(0, 3);
  if (!any()) return choose_anchor();
  // A random subset of each handle's pairs; each handle has the same total weight, times its own.
  Random random(static_cast<std::uint64_t>(problem_.options.seed), 1);
  std::vector<double> weights;
  for (Index i = 0; i < bound_.count(); ++i) {
    const Index held = bound_.begin(i + 1) - bound_.begin(i);
    std::vector<Index> rows = random_subset(held, problem_.options.handle_samples, random);
    const auto missed = missed_rows(bound_.sources().middleRows(bound_.begin(i), held), rows);
    rows.insert(rows.end(), missed.begin(), missed.end());
    const double share = 1.0 / static_cast<double>(static_cast<Index>(rows.size()) * bound_.count());
    for (const Index row : rows) {
      rows_.push_back(bound_.begin(i) + row);
      weights.push_back(bound_.handle(i).weight * share);
    }
  }
  // Fixed samples beyond the influence.
  if (influence_) {
    const Vector share = influence_->at(problem_.surface());
    std::vector<Index> beyond;
    for (Index i = 0; i < share.size(); ++i)
      if (share[i] == 0.0) beyond.push_back(i);
    std::vector<Index> some =
        random_subset(static_cast<Index>(beyond.size()), problem_.options.handle_samples, random);
    for (Index& row : some) row = beyond[static_cast<std::size_t>(row)];
    held_ = rows_of(problem_.surface(), some);
    for (std::size_t k = 0; k < some.size(); ++k)
      weights.push_back(1.0 / static_cast<double>(held_.rows() * bound_.count()));
  }
  const auto count = static_cast<Index>(weights.size());
  pairs_ = {Points(count, 3), Points(count, 3), Eigen::Map<const Vector>(weights.data(), count)};
  pairs_.sources << rows_of(bound_.sources(), rows_), held_;
  pairs_.targets << rows_of(bound_.targets(), rows_), held_;
  reflect_pairs();
}

void HandleTerms::choose_anchor() {
  Index lowest = 0;
  (problem_.surface() * up_).minCoeff(&lowest);
  const Points place = problem_.surface().row(lowest);
  pairs_ = {place, place, Vector::Constant(1, anchor_weight / problem_.options.handle_weight)};
  reflect_pairs();
}

void HandleTerms::move_anchor(const Vec3& place) { pairs_.targets = with_reflections(place.transpose()); }

void HandleTerms::rest_anchor() {
  if (!any()) choose_anchor();
}

/// Adds each pair's reflection, with half of the weight for both: for symmetric fields the energy is the
/// same, and the preconditioner becomes symmetric.
void HandleTerms::reflect_pairs() {
  if (!problem_.mirror) return;
  pairs_.sources = with_reflections(std::move(pairs_.sources));
  pairs_.targets = with_reflections(std::move(pairs_.targets));
  pairs_.weights = (0.5 * pairs_.weights).replicate(2, 1).eval();
}

Points HandleTerms::with_reflections(Points points) const {
  if (!problem_.mirror) return points;
  Points both(2 * points.rows(), 3);
  both << points, problem_.mirror->reflected(points);
  return both;
}

/// Limits the influence if all handles that move have a reach. Returns whether it has changed.
bool HandleTerms::update_influence() {
  std::shared_ptr<const Influence> next = reaches_;
  for (Index i = 0; i < bound_.count() && next; ++i) {
    const Index begin = bound_.begin(i), rows = bound_.begin(i + 1) - begin;
    const Points way = bound_.targets().middleRows(begin, rows) - bound_.sources().middleRows(begin, rows);
    if (bound_.handle(i).reach == 0.0 && way.rowwise().norm().maxCoeff() > hardly_moved) next.reset();
  }
  influence_.swap(next);
  return influence_ != next;
}

std::shared_ptr<const Influence> HandleTerms::reaches() const {
  std::vector<Vec3> places;
  std::vector<double> distances;
  for (Index i = 0; i < bound_.count(); ++i) {
    const Index rows = bound_.begin(i + 1) - bound_.begin(i);
    const auto sources = bound_.sources().middleRows(bound_.begin(i), rows);
    const double reach = bound_.handle(i).reach;
    if (reach == 0.0) continue;
    FarthestPoints chosen;
    for (Index count = 1; count <= most_places; count *= 4) {
      chosen = farthest_points(sources, count);
      if (chosen.fill_distance <= place_spacing * reach) break;
    }
    for (const Index row : chosen.indices) {
      places.push_back(sources.row(row));
      if (problem_.mirror) places.push_back(problem_.mirror->reflected(sources.row(row)).row(0));
      distances.resize(places.size(), reach);
    }
  }
  if (places.empty()) return nullptr;
  const Index count = static_cast<Index>(places.size());
  Points rows(count, 3);
  for (Index i = 0; i < count; ++i) rows.row(i) = places[static_cast<std::size_t>(i)].transpose();
  return std::make_shared<const Influence>(rows, Eigen::Map<const Vector>(distances.data(), count),
                                           problem_.basis.embedding);
}

Points HandleTerms::targets_at(const std::vector<Mat4>& motions) const {
  if (!any()) return pairs_.targets;
  Points own(own_count() + held_.rows(), 3);
  own << targets_of(bound_, motions, rows_), held_;
  return with_reflections(std::move(own));
}

Index HandleTerms::handle_of(Index pair) const {
  Index handle = 0;
  while (any() && rows_[static_cast<std::size_t>(pair)] >= bound_.begin(handle + 1)) ++handle;
  return handle;
}

const RowMatrix<double>& HandleTerms::basis_values() {
  return basis_values_.get({revision_},
                           [&] { return radial_rows(problem_.basis, pairs_.sources, JetOrder::value); });
}

const PartLinks& HandleTerms::links() {
  return links_.get({revision_}, [&] { return PartLinks(problem_, pairs_.sources); });
}

}  // namespace arapfields
