// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "sampling/root_isolation.h"

namespace arapfields {

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
