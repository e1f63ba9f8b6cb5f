// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "solve/radial/problem.h"

namespace arapfields {

/// Links from disconnected parts of a surface without handles to the nearest parts that are held, a minimum
/// spanning forest. The energy of a link from x to y = x + d is ‖f(y) − f(x) − J(x) d‖²/‖d‖² + ‖J(y) −
/// J(x)‖²; it is 0 for a common affine motion. A part's own energy does not depend on its position relative
/// to the others: without links, rounding would determine it.
class PartLinks {
 public:
  PartLinks() = default;
  /// `held` (n,3) are the sources of handles' pairs. Links do not end in the boxes of exact handles.
  PartLinks(const RadialProblem& problem, Points held);

  /// The ends of the links (n,3 each).
  const Points& from() const { return from_; }
  const Points& to() const { return to_; }
  /// Residuals (4 n, 3), whose squares sum to the energy, from a field's first-order jets (4 n, 3) at the
  /// ends.
  RowMatrix<double> values(const RowMatrix<double>& at_from, const RowMatrix<double>& at_to) const;
  /// Residuals (4 n, size) of the basis functions.
  const RowMatrix<double>& rows() const { return rows_; }

 private:
  Points from_ = Points(0, 3);
  Points to_ = Points(0, 3);
  RowMatrix<double> rows_;
};

}  // namespace arapfields
