// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "sampling/tricubic_surrogate.h"

namespace arapfields {

/// A part of a line in which Φ has exactly one sign change.
struct Bracket {
  Index line = 0;
  double low = 0.0, high = 0.0;  ///< parameters on the line
  double guess = 0.0;            ///< where the zero is expected
  double slope = 0.0;            ///< expected dΦ/dt there; its sign is that of Φ at `high`
};

/// A part of a line where the model's error bound leaves the number of zeros open: Φ must be evaluated.
struct AmbiguousInterval {
  Index line = 0;
  double low = 0.0, high = 0.0;
};

struct ScanResult {
  std::vector<Bracket> brackets;
  std::vector<AmbiguousInterval> ambiguous;
};

/// All crossings of the lines that the model can isolate, ordered by line and parameter, without evaluating
/// Φ. A step along a line has no zero where |p| exceeds the model's error, and at most one where |dp/dt|
/// exceeds the model's slope error. Other runs of steps are ambiguous.
ScanResult scan_lines(const TricubicSurrogate& model, const std::vector<Line>& lines);

}  // namespace arapfields
