// SPDX-License-Identifier: GPL-3.0-or-later
// How a live solver finds folds between the samples that its energy sees.
#include <cmath>
#include <tuple>

#include "core/parallel.h"
#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "solve/radial/state.h"

namespace arapfields {

/// As little as these samples add to the rest surface's stiffness, the preconditioner stays.
Index RadialSolver::State::watch_folds(double barrier) {
  const ThreadScope threads(options_.threads);
  const std::size_t before = chosen_.size();
  std::vector<bool> seen(static_cast<std::size_t>(surface_.rows()), false);
  for (const Index i : chosen_) seen[static_cast<std::size_t>(i)] = true;
  std::vector<Index> unseen;
  for (const std::uint32_t i : order_)
    if (!seen[i]) unseen.push_back(i);
  const Index count = static_cast<Index>(unseen.size());
  JetBlock<double> jets(count, JetOrder::first);
  field()->evaluate(rows_of(surface_, unseen), jets.view());
  Index folded = 0;
  for (Index p = 0; p < count; ++p) {
    Mat3 jacobian;
    for (int k = 0; k < 3; ++k) jacobian.col(k) = Eigen::Map<const Vec3>(jets.view().at(first_column(k), p));
    const double determinant = jacobian.determinant();
    if (determinant <= 0.0) ++folded;
    if (determinant < options_.surface.barrier_threshold)
      chosen_.push_back(unseen[static_cast<std::size_t>(p)]);
  }
  folded += static_cast<Index>(std::ceil(report_.distortion.flipped_share * static_cast<double>(before)));
  if (folded == 0) {
    chosen_.resize(before);
    return 0;
  }
  options_.surface.barrier = barrier;
  own_bending_ = surface_stiffness_.bending(rows_of(surface_, chosen_));
  std::tie(weights_, bending_) = resistance();
  choose_stance();
  if (style_) style_ = style_at_samples(*style_asked_);
  if (body_.asked) set_secondary_motion(body_.asked);
  exact_ = {};
  prepare(fast_);
  fast_.u.resize(0);
  u_before_.resize(0);
  optimizer_.forget();
  return folded;
}

}  // namespace arapfields
