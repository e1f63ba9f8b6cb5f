// SPDX-License-Identifier: GPL-3.0-or-later
// What a live solver's surface resists with, and what pulls at it.
#include <cmath>

#include "core/parallel.h"
#include "core/random.h"
#include "sampling/sample_choice.h"
#include "sampling/sample_weights.h"
#include "solve/radial/state.h"
#include "solve/radial/stiffness.h"
#include "solve/setup.h"
#include "solve/surface_stiffness.h"

namespace arapfields {
namespace {

/// Weight, against the surface's energy, with which a style without handles holds the lowest sample in place.
constexpr double anchor_weight = 1.0;

/// A way, in cube units, that a handle without a reach may have come and still only holds.
constexpr double hardly_moved = 1e-4;
/// Places of a handle that its reach is measured from: so far apart, in reaches, or so many.
constexpr double place_spacing = 0.25;
constexpr Index most_places = 256;

}  // namespace

void RadialSolver::State::choose_pairs() {
  pair_rows_.clear();
  held_.resize(0, 3);
  if (handles_.empty()) {
    Index lowest = 0;
    (surface_ * up_).minCoeff(&lowest);
    pairs_ = {surface_.row(lowest), surface_.row(lowest),
              Vector::Constant(1, anchor_weight / options_.handle_weight)};
    reflect_pairs();
    return;
  }
  Random random(static_cast<std::uint64_t>(options_.seed), 1);
  std::vector<double> weights;
  for (Index i = 0; i < bound_.count(); ++i) {
    const std::vector<Index> rows =
        random_subset(bound_.begin(i + 1) - bound_.begin(i), options_.handle_samples, random);
    const double share = 1.0 / static_cast<double>(static_cast<Index>(rows.size()) * bound_.count());
    for (const Index row : rows) {
      pair_rows_.push_back(bound_.begin(i) + row);
      weights.push_back(bound_.handle(i).weight * share);
    }
  }
  if (influence_) {
    const Vector share = influence_->at(surface_);
    std::vector<Index> beyond;
    for (Index i = 0; i < share.size(); ++i)
      if (share[i] == 0.0) beyond.push_back(i);
    std::vector<Index> some;
    for (const Index k : random_subset(static_cast<Index>(beyond.size()), options_.handle_samples, random))
      some.push_back(beyond[static_cast<std::size_t>(k)]);
    held_ = rows_of(surface_, some);
    for (std::size_t k = 0; k < some.size(); ++k)
      weights.push_back(1.0 / static_cast<double>(static_cast<Index>(some.size()) * bound_.count()));
  }
  Points sources(static_cast<Index>(weights.size()), 3);
  sources << rows_of(bound_.sources(), pair_rows_), held_;
  pairs_ = {sources, pair_targets(),
            Eigen::Map<const Vector>(weights.data(), static_cast<Index>(weights.size()))};
  reflect_pairs();
}

/// Where all handles that move have a reach, what is beyond all of these is held. Whether that has changed.
bool RadialSolver::State::choose_influence() {
  std::shared_ptr<const Influence> next = reaches_;
  for (Index i = 0; i < bound_.count() && next; ++i) {
    const Index begin = bound_.begin(i), rows = bound_.begin(i + 1) - begin;
    const Points way = bound_.targets().middleRows(begin, rows) - bound_.sources().middleRows(begin, rows);
    if (bound_.handle(i).reach == 0.0 && way.rowwise().norm().maxCoeff() > hardly_moved) next.reset();
  }
  const bool changed = next != influence_;
  influence_ = std::move(next);
  if (changed && tracked_.size() > 0) tracked_.set_influence(influence_.get());
  return changed;
}

std::shared_ptr<const Influence> RadialSolver::State::reaches_of_handles() const {
  std::vector<Vec3> places;
  std::vector<double> reaches;
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
      reaches.push_back(reach);
      if (!mirror_) continue;
      places.push_back(mirror_->reflected(sources.row(row)).row(0));
      reaches.push_back(reach);
    }
  }
  if (places.empty()) return nullptr;
  const Index count = static_cast<Index>(places.size());
  Points rows(count, 3);
  for (Index i = 0; i < count; ++i) rows.row(i) = places[static_cast<std::size_t>(i)].transpose();
  return std::make_shared<const Influence>(rows, Eigen::Map<const Vector>(reaches.data(), count),
                                           basis_.embedding);
}

Points RadialSolver::State::pair_targets() const {
  Points result(static_cast<Index>(pair_rows_.size()) + held_.rows(), 3);
  result << rows_of(bound_.targets(), pair_rows_), held_;
  return result;
}

/// What pulls at a point pulls at its reflection as well: a symmetric field feels no difference, and the
/// preconditioner becomes symmetric.
void RadialSolver::State::reflect_pairs() {
  if (!mirror_) return;
  const Index n = pairs_.weights.size();
  const HandleBatch<double> own = pairs_;
  pairs_.sources.resize(2 * n, 3);
  pairs_.targets.resize(2 * n, 3);
  pairs_.weights.resize(2 * n);
  pairs_.sources << own.sources, mirror_->reflected(own.sources);
  pairs_.targets << own.targets, mirror_->reflected(own.targets);
  pairs_.weights << 0.5 * own.weights, 0.5 * own.weights;
}

void RadialSolver::State::set_weights(const Vector& weights, const Vector& bend_weights) {
  const ThreadScope threads(options_.threads);
  samples_ = with_weights(samples_, weights, bend_weights);
  stiffen({});
  inverse_factor_.resize(0, 0);
  if (!handles_.empty()) factorise();
}

/// w of each sample that the energy sees (empty: all 1), and λ.
std::pair<Vector, Vector> RadialSolver::State::resistance() const {
  const Vector all = energy_weights(samples_, bound_);
  Vector weights(all.size() > 0 ? static_cast<Index>(chosen_.size()) : 0), bending = own_bending_;
  for (std::size_t i = 0; i < chosen_.size(); ++i) {
    const auto row = static_cast<Index>(i);
    if (weights.size() > 0) weights[row] = all[chosen_[i]];
    if (samples_.bend_weights.size() > 0) bending[row] *= samples_.bend_weights[chosen_[i]];
  }
  return {weights, bending};
}

/// The samples' resistance, where their weights or handles that scale have changed it.
void RadialSolver::State::stiffen(const Progress& progress) {
  const auto [weights, bending] = resistance();
  if (stiffness_.size() > 0 && weights.size() == weights_.size() && weights == weights_ &&
      bending == bending_)
    return;
  weights_ = weights;
  bending_ = bending;
  stiffness_ =
      stiffness_matrix(basis_, rows_of(surface_, chosen_), bending_, weights_, progress, blend_.get());
  if (mirror_) mirror_->symmetrise_matrix(stiffness_);
  body_.smoothing.resize(0, 0);
  for_each_precision([&](auto& precision) { precision.objective->set_stiffness(bending_, weights_); });
}

void RadialSolver::State::set_handles(const std::vector<Handle>& handles) {
  const ThreadScope threads(options_.threads);
  if (style_) require_no_reach(handles);
  bound_ = BoundHandles(in_cube(handles, frame_), surface_);
  handles_ = handles;
  body_.motions.clear();
  stiffen({});
  reaches_ = reaches_of_handles();
  choose_influence();
  choose_pairs();
  choose_stance();
  inverse_factor_.resize(0, 0);
  if (!handles_.empty()) factorise();
}

/// The preconditioner of the handles and the stance at hand.
void RadialSolver::State::factorise() {
  pair_values_ = radial_rows(basis_, pairs_.sources, JetOrder::value);
  RowMatrix<double> values = pair_values_;
  Vector weights = options_.handle_weight * pairs_.weights;
  const auto add = [&](RowMatrix<double> rows, Vector shares) {
    if (mirror_) {
      const RowMatrix<double> other = mirror_->reflected_rows(rows);
      rows.conservativeResize(2 * other.rows(), Eigen::NoChange);
      rows.bottomRows(other.rows()) = other;
      shares = 0.5 * shares.replicate(2, 1).eval();
    }
    values.conservativeResize(values.rows() + rows.rows(), Eigen::NoChange);
    weights.conservativeResize(values.rows());
    values.bottomRows(rows.rows()) = rows;
    weights.tail(rows.rows()) = shares;
  };
  if (stance_) {
    auto [rows, shares] = stance_rows(basis_, stance_->rest, stance_->stance);
    add(std::move(rows), stance_->weight * shares);
  }
  if (body_.factored_inertia > 0.0)
    add(radial_rows(basis_, rows_of(surface_, chosen_), JetOrder::value),
        0.5 * body_.factored_inertia / static_cast<double>(chosen_.size()) * body_.masses);
  inverse_factor_ = inverse_factor(stiffness_, values, weights);
  for_each_precision([&](auto& precision) {
    precision.objective->set_handles(pairs_, pair_values_, inverse_factor_);
    precision.objective->set_stance(stance_);
    precision.u.resize(0);
  });
  u_before_.resize(0);
  optimizer_.forget();
}

void RadialSolver::State::set_targets(const std::vector<Handle>& moved) {
  bound_.retarget(in_cube(moved, frame_));
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    handles_[i].target = moved[i].target;
    handles_[i].target_point = moved[i].target_point;
  }
  if (handles_.empty()) return;
  if (choose_influence()) {
    choose_pairs();
    return factorise();
  }
  pairs_.targets = pair_targets();
  if (mirror_) {
    const Points own = pairs_.targets;
    pairs_.targets.resize(2 * own.rows(), 3);
    pairs_.targets << own, mirror_->reflected(own);
  }
  for_each_precision([&](auto& precision) { precision.objective->set_targets(pairs_.targets); });
}

}  // namespace arapfields
