// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "solve/radial/problem.h"
#include "solve/radial/terms.h"

namespace arapfields {

/// The style term at the energy samples, and the stance term of a styled figure without handles.
class StyleTerms {
 public:
  explicit StyleTerms(const RadialProblem& problem) : problem_(problem) {}
  /// An idle style, or one of strength 0, is removed. Throws InvalidInput for numbers out of range, and for
  /// samples without normals.
  void set(const StyleRequest& request);
  void clear();

  bool any() const { return request_.has_value(); }
  const std::optional<StyleRequest>& request() const { return request_; }
  const std::optional<StyleTerm<double>>& style();
  const std::optional<StanceTerm<double>>& stance(bool has_handles);
  Revision revision() const { return revision_; }
  /// Revision of the stance, which does not depend on the style's strength; 0 without one.
  Revision stance_revision(bool has_handles) const {
    return keeps_stance(has_handles) ? stance_revision_ : 0;
  }

 private:
  StyleTerm<double> at_samples(const StyleRequest& request) const;
  bool keeps_stance(bool has_handles) const {
    return any() && !has_handles && problem_.options.keep_stance > 0.0;
  }

  const RadialProblem& problem_;
  std::optional<StyleRequest> request_;
  Dependent<std::optional<StyleTerm<double>>, 2> style_;
  Dependent<std::optional<StanceTerm<double>>, 2> stance_;
  Revision revision_ = 0;
  Revision stance_revision_ = 0;
};

}  // namespace arapfields
