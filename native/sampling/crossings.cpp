// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/crossings.h"

#include <algorithm>
#include <cmath>

namespace arapfields {
namespace {

constexpr int max_rounds = 40;
constexpr int max_gradients = 3;  // gradients for each zero, if rounding keeps |Φ| above the tolerance
constexpr double acceptable_value = 1e-4;
// A secant step from here is expected to end below the tolerance: the next evaluation takes the gradient.
constexpr double near_tolerance = 3e-4;
constexpr double narrowest_bracket = 1e-8;

/// The state of the root search in one bracket.
struct RootSearch {
  Index bracket = 0;
  int low_sign = 0;              // of Φ at low
  double low = 0.0, high = 0.0;  // around the zero
  double t = 0.0;                // where Φ is evaluated next …
  double slope = 0.0;            // … and its slope as far as known
  double old_t = 0.0, old_value = 0.0;
  double old_width = 0.0;
  int rounds = 0, gradients_taken = 0;
  bool wants_gradient = false;  // the next evaluation takes the gradient
  bool done = false;

  /// Updates the bracket with Φ(t) and its slope, and chooses the next parameter.
  void step_to_next(double value, double new_slope) {
    slope = new_slope;
    ((value < 0.0 ? -1 : 1) == low_sign ? low : high) = t;
    old_t = t;
    old_value = value;
    bool stalled = false;
    if (++rounds % 4 == 0) {
      stalled = high - low > 0.25 * old_width;
      old_width = high - low;
    }
    wants_gradient = std::abs(value) < near_tolerance;
    t -= value / slope;
    if (!(t > low && t < high) || stalled) t = 0.5 * (low + high);
  }
  void update_with_value(double value, double tolerance) {
    const double at = t;
    const bool secant = rounds > 0 && std::abs(t - old_t) > 1e-6;
    step_to_next(value, secant ? (value - old_value) / (t - old_t) : slope);
    if (rounds == 1) wants_gradient = false;  // its slope is the model's
    if (std::abs(value) > tolerance && high - low > narrowest_bracket) return;
    t = at;
    wants_gradient = true;
  }
  void update_with_gradient(double value, double new_slope, double tolerance) {
    done = std::abs(value) <= tolerance || high - low < narrowest_bracket ||
           (++gradients_taken == max_gradients && std::abs(value) <= acceptable_value);
    if (!done) step_to_next(value, new_slope != 0.0 ? new_slope : slope);
  }
};

}  // namespace

Crossings find_crossings(EvaluationCounter& function, const std::vector<Line>& lines,
                         const std::vector<Bracket>& brackets, double tolerance) {
  const auto total = static_cast<Index>(brackets.size());
  PointsF points(total, 3), gradients(total, 3);
  std::vector<double> best(brackets.size(), 1e30);
  std::vector<RootSearch> active(brackets.size());
  for (std::size_t i = 0; i < brackets.size(); ++i) {
    const Bracket& b = brackets[i];
    active[i] = {.bracket = static_cast<Index>(i),
                 .low_sign = b.slope > 0.0 ? -1 : 1,
                 .low = b.low,
                 .high = b.high,
                 .t = b.guess,
                 .slope = b.slope,
                 .old_width = b.high - b.low};
  }
  const auto line_of = [&](const RootSearch& s) -> const Line& { return lines[brackets[s.bracket].line]; };
  for (int round = 0; round < max_rounds && !active.empty(); ++round) {
    const auto plain_end = std::stable_partition(active.begin(), active.end(),
                                                 [](const RootSearch& s) { return !s.wants_gradient; });
    const auto plain = static_cast<Index>(plain_end - active.begin());
    PointsF batch(static_cast<Index>(active.size()), 3), slopes;
    for (Index row = 0; row < batch.rows(); ++row) {
      const RootSearch& s = active[row];
      batch.row(row) = line_of(s).at(s.t).cast<float>();
    }
    const VectorF values = function.values(batch.topRows(plain));
    const VectorF ends = function.values(batch.bottomRows(batch.rows() - plain), slopes);
    for (Index row = 0; row < batch.rows(); ++row) {
      RootSearch& s = active[row];
      if (row < plain) {
        s.update_with_value(values[row], tolerance);
        continue;
      }
      const double value = ends[row - plain];
      double& least = best[s.bracket];
      if (std::abs(value) < least) {
        least = std::abs(value);
        points.row(s.bracket) = batch.row(row);
        gradients.row(s.bracket) = slopes.row(row - plain);
      }
      s.update_with_gradient(value, slopes.row(row - plain).cast<double>().dot(line_of(s).direction),
                             tolerance);
    }
    std::erase_if(active, [](const RootSearch& s) { return s.done; });
  }
  Crossings result;
  for (Index i = 0; i < total; ++i) {
    const double value = best[i];
    (value <= acceptable_value ? result.bracket : result.failed).push_back(i);
    if (value <= acceptable_value) result.largest = std::max(result.largest, value);
  }
  result.points.resize(result.bracket.size(), 3);
  result.gradients.resize(result.points.rows(), 3);
  for (Index row = 0; row < result.points.rows(); ++row) {
    result.points.row(row) = points.row(result.bracket[row]);
    result.gradients.row(row) = gradients.row(result.bracket[row]);
  }
  return result;
}

}  // namespace arapfields
