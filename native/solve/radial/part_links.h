// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/problem.h"

namespace arapfields {

/// What keeps parts of a surface that nothing holds beside those that are held. The energy of a link: how far
/// its second place is from where the field near the first one would take it, in lengths of the link, and how
/// unlike the field's slopes are at both; motions of both as one cost nothing. A part's own energy does not
/// feel how it lies to others: without links, rounding would decide.
class PartLinks {
 public:
  PartLinks() = default;
  /// `held` (n,3) are the places that something pulls at. Links avoid what exact handles decide.
  PartLinks(const RadialProblem& problem, Points held);

  /// The places of the links (n,3 each).
  const Points& from() const { return from_; }
  const Points& to() const { return to_; }
  /// (4 n, 3) Numbers whose squares add up to the energy, from a field's jets of first order (4 n, 3).
  RowMatrix<double> values(const RowMatrix<double>& at_from, const RowMatrix<double>& at_to) const;
  /// (4 n, basis) These numbers of the basis functions.
  const RowMatrix<double>& rows() const { return rows_; }

 private:
  Points from_ = Points(0, 3);
  Points to_ = Points(0, 3);
  RowMatrix<double> rows_;
};

}  // namespace arapfields
