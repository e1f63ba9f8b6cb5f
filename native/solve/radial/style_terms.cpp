// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/style_terms.h"

#include <string>

#include "core/errors.h"
#include "sampling/sample_choice.h"

namespace arapfields {

void StyleTerms::set(const StyleRequest& request) {
  require_range("strength", request.strength, 0, 1e6);
  const Index count = problem_.samples.size();
  const Vector weights = problem_.at_all("weights", request.weights);
  require(weights.size() == 0 || (weights.allFinite() && weights.minCoeff() >= 0), "weights",
          std::to_string(weights.size()) + " numbers, or negative or non-finite ones",
          "one weight ≥ 0 for each of the " + std::to_string(count) + " samples, or none, is needed");
  if (request.strength == 0.0) return clear();
  require(problem_.samples.normals.rows() == count, "samples", "they have no normals",
          "a style needs samples with normals");
  WeightedStyle style = at_samples(request);
  if (style.style.idle(rows_of(problem_.samples.normals, problem_.energy_samples))) return clear();
  require(request.up.allFinite() && request.up.norm() > 0.0, "up", "zero, NaN or infinite",
          "a finite direction is needed");
  if (!any() || request_->up != request.up) ++stance_revision_;
  request_ = request;
  style_.set({problem_.energy_revision, ++revision_}, std::move(style));
}

void StyleTerms::clear() {
  request_.reset();
  ++revision_;
}

const std::optional<WeightedStyle>& StyleTerms::style() {
  return style_.get({problem_.energy_revision, revision_},
                    [&] { return any() ? std::optional(at_samples(*request_)) : std::nullopt; });
}

WeightedStyle StyleTerms::at_samples(const StyleRequest& request) const {
  const Points normals = rows_of(problem_.samples.normals, problem_.energy_samples);
  StyleAtSamples style = StyleAtSamples::of(request.style, normals, request.sharpness);
  if (request.weights.size() > 0)
    style.weights.array() *=
        entries_of(problem_.at_all("weights", request.weights), problem_.energy_samples).array();
  if (const Vector areas = problem_.energy_areas(); areas.size() > 0) style.weights.array() *= areas.array();
  const double weight = style.share(request.strength) * problem_.options.gauss_weight * style.factor;
  return {std::move(style), weight};
}

const std::optional<WeightedStance>& StyleTerms::stance(bool has_handles) {
  const Revision revision = stance_revision(has_handles);
  return stance_.get({problem_.energy_revision, revision}, [&]() -> std::optional<WeightedStance> {
    if (revision == 0) return std::nullopt;
    return WeightedStance{Stance::of(problem_.surface(), request_->up).at(problem_.energy_samples),
                          problem_.options.keep_stance};
  });
}

}  // namespace arapfields
