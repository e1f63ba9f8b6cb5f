// SPDX-License-Identifier: GPL-3.0-or-later
// What the live solver knows of styles, and of the stance that a styled figure keeps.
#include <string>

#include "core/errors.h"
#include "sampling/sample_choice.h"
#include "solve/radial/state.h"
#include "solve/setup.h"

namespace arapfields {

void RadialSolver::State::set_style(const Style& style, double strength, double sharpness,
                                    const Vector& weights, const Vec3& up) {
  require_range("strength", strength, 0, 1e6);
  require(
      weights.size() == 0 ||
          (weights.size() == surface_.rows() && weights.allFinite() && weights.minCoeff() >= 0),
      "weights", std::to_string(weights.size()) + " numbers, or negative or non-finite ones",
      "one weight ≥ 0 for each of the " + std::to_string(surface_.rows()) + " samples, or none, is needed");
  if (strength == 0.0) return clear_style();
  require(surface_normals_.rows() == surface_.rows(), "samples", "they have no normals",
          "a style needs samples with normals");
  require_no_reach(handles_);
  StyleAsked asked{style, strength, sharpness, weights, up};
  RadialStyle here = style_at_samples(asked);
  if (here.style.idle(here.normals)) return clear_style();
  require(up.allFinite() && up.norm() > 0.0, "up", "zero, NaN or infinite", "a finite direction is needed");
  const bool other_way_up = up != up_, first = !style_;
  style_asked_ = std::move(asked);
  up_ = up;
  style_ = std::move(here);
  for_each_precision([&](auto& precision) { precision.objective->set_style(style_); });
  optimizer_.forget();
  if (handles_.empty() && (first || other_way_up)) stand_otherwise();
}

/// The style at the samples that the energy sees.
RadialStyle RadialSolver::State::style_at_samples(const StyleAsked& asked) const {
  RadialStyle here;
  here.normals = rows_of(surface_normals_, chosen_);
  here.style = StyleAtSamples::of(asked.style, here.normals, asked.sharpness);
  if (asked.weights.size() > 0)
    for (std::size_t i = 0; i < chosen_.size(); ++i)
      here.style.weights[static_cast<Index>(i)] *= asked.weights[chosen_[i]];
  here.weight = asked.strength * options_.gauss_weight * here.style.factor;
  return here;
}

void RadialSolver::State::clear_style() {
  const bool stood = stance_.has_value();
  style_.reset();
  style_asked_.reset();
  for_each_precision([&](auto& precision) { precision.objective->set_style(style_); });
  optimizer_.forget();
  if (stood) stand_otherwise();
}

/// What is held of a figure without handles has changed; the next solve makes up for it.
void RadialSolver::State::stand_otherwise() {
  choose_pairs();
  choose_stance();
  inverse_factor_.resize(0, 0);
}

/// Without handles, a style's figure keeps its stance.
void RadialSolver::State::choose_stance() {
  stance_.reset();
  if (style_ && handles_.empty() && options_.keep_stance > 0.0)
    stance_ =
        RadialStance{Stance::of(surface_, up_).at(chosen_), rows_of(surface_, chosen_), options_.keep_stance};
}

}  // namespace arapfields
