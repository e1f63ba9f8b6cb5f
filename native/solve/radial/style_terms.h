// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "energies/stance.h"
#include "energies/style.h"
#include "solve/radial/problem.h"

namespace arapfields {

struct StyleRequest {
  Style style;
  double strength;
  double sharpness;  ///< 0: the style's own
  Vector weights;    ///< of all samples; empty: all 1
  Vec3 up;           ///< the figure's upward direction
};

/// A style at the energy samples, and its weight.
struct WeightedStyle {
  StyleAtSamples style;
  double weight = 1.0;  ///< λ_Gauss
};

/// A stance of the energy samples, and its weight.
struct WeightedStance {
  Stance stance;
  double weight = 0.0;
};

/// The style at the energy samples, and the stance of a styled figure without handles.
class StyleTerms {
 public:
  explicit StyleTerms(const RadialProblem& problem) : problem_(problem) {}
  /// An idle style, or one of strength 0, is removed. Throws InvalidInput for numbers out of range, and for
  /// samples without normals.
  void set(const StyleRequest& request);
  void clear();

  bool any() const { return request_.has_value(); }
  const std::optional<StyleRequest>& request() const { return request_; }
  const std::optional<WeightedStyle>& style();
  const std::optional<WeightedStance>& stance(bool has_handles);
  Revision revision() const { return revision_; }
  /// Revision of the stance, which does not depend on the style's strength; 0 without one.
  Revision stance_revision(bool has_handles) const {
    return keeps_stance(has_handles) ? stance_revision_ : 0;
  }

 private:
  WeightedStyle at_samples(const StyleRequest& request) const;
  bool keeps_stance(bool has_handles) const {
    return any() && !has_handles && problem_.options.keep_stance > 0.0;
  }

  const RadialProblem& problem_;
  std::optional<StyleRequest> request_;
  Dependent<std::optional<WeightedStyle>, 2> style_;
  Dependent<std::optional<WeightedStance>, 2> stance_;
  Revision revision_ = 0;
  Revision stance_revision_ = 0;
};

}  // namespace arapfields
