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

inline constexpr double finest_interval = 2e-4;

/// Evaluates Φ in the ambiguous intervals until every crossing there has its bracket. All intervals are
/// bisected at once. An interval is done when Φ − p, known at its ends and bounded in slope, excludes a
/// second zero or any, or when it is shorter than `finest`. Pairs of zeros within that length may be missed,
/// and zeros between near points with Φ = 0 exactly; the lengths of these are added to `zero_length`.
/// Throws InvalidInput if there are more intervals than a surface can have: Φ is noise.
std::vector<Bracket> resolve_ambiguous(EvaluationCounter& function, const TricubicSurrogate& model,
                                       const std::vector<Line>& lines,
                                       const std::vector<AmbiguousInterval>& ambiguous,
                                       double finest = finest_interval, double* zero_length = nullptr);

struct Crossings {
  std::vector<Index> bracket;  ///< bracket of each point, ascending
  PointsF points;              ///< (n,3)
  PointsF gradients;           ///< (n,3) of Φ
  double largest = 0.0;        ///< largest |Φ| of the points
  std::vector<Index> failed;   ///< brackets in which no |Φ| ≤ 1e-4 was found
};

/// The zero in every bracket by safeguarded secant steps, all brackets at once, until |Φ| ≤ tolerance (or as
/// near as float32 coordinates come, below 1e-4). Two values and one gradient are typical.
Crossings find_crossings(EvaluationCounter& function, const std::vector<Line>& lines,
                         const std::vector<Bracket>& brackets, double tolerance);

}  // namespace arapfields
