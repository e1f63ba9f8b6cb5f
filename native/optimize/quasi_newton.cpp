// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/quasi_newton.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/errors.h"

namespace arapfields {
namespace {

// Algorithms and equations: Nocedal & Wright, Numerical Optimization, 2nd edition, 2006.
constexpr std::size_t history = 12;
constexpr double armijo = 1e-4, wolfe = 0.9;  // c1 and c2 of (3.6)

double dot(const RowMatrix<double>& a, const RowMatrix<double>& b) { return a.cwiseProduct(b).sum(); }

/// A point of the line u + t du: value, slope, and the cotangents there.
template <class Scalar>
struct Trial {
  double t = 0.0, value = 0.0, slope = 0.0;
  Eigen::VectorX<Scalar> u, cotangents;
};

/// Minimiser (3.59) of the cubic Hermite interpolant of two trials, safeguarded from the interval's ends.
template <class Scalar>
double cubic_minimum(const Trial<Scalar>& a, const Trial<Scalar>& b) {
  const double d1 = a.slope + b.slope - 3.0 * (a.value - b.value) / (a.t - b.t);
  const double square = d1 * d1 - a.slope * b.slope;
  const double low = std::min(a.t, b.t), high = std::max(a.t, b.t), margin = 0.1 * (high - low);
  double t = 0.5 * (low + high);
  if (square >= 0.0) {
    const double d2 = std::copysign(std::sqrt(square), b.t - a.t);
    const double candidate = b.t - (b.t - a.t) * (b.slope + d2 - d1) / (b.slope - a.slope + 2.0 * d2);
    if (std::isfinite(candidate)) t = candidate;
  }
  return std::clamp(t, low + margin, high - margin);
}

/// A step that meets the Wolfe conditions (3.6), or at least the first; t = 0 where none is found.
template <class Scalar>
Trial<Scalar> search_line(const MeasuredObjectiveOf<Scalar>& objective, const Trial<Scalar>& start,
                          const Eigen::VectorX<Scalar>& du, Index& evaluations) {
  const auto at = [&](double t) {
    Trial<Scalar> trial;
    trial.t = t;
    trial.u = start.u + static_cast<Scalar>(t) * du;
    trial.value = objective.value(trial.u, &trial.cotangents);
    trial.slope = static_cast<double>(trial.cotangents.dot(du));
    ++evaluations;
    return trial;
  };
  const auto falls = [&](const Trial<Scalar>& trial) {
    return std::isfinite(trial.value) && std::isfinite(trial.slope) &&
           trial.value <= start.value + armijo * trial.t * start.slope;
  };
  Trial<Scalar> low = start, next = at(objective.first_trial(start.u, du, start.slope));
  for (int tries = 0; tries < 12; ++tries) {
    if (!falls(next) || (next.value >= low.value && low.t > 0.0)) {  // the minimum lies between low and next
      const bool usable = std::isfinite(next.value) && std::isfinite(next.slope);
      next = at(usable ? cubic_minimum(low, next) : low.t + 0.2 * (next.t - low.t));
      continue;
    }
    if (std::abs(next.slope) <= -wolfe * start.slope || tries >= 4) return next;
    const double t = next.slope < 0.0 ? 3.0 * next.t : cubic_minimum(low, next);
    low = next;
    next = at(t);
  }
  return falls(low) ? low : start;
}

}  // namespace

/// The two-loop recursion (algorithm 7.4), with the preconditioner as the initial inverse Hessian.
template <class Scalar>
RowMatrix<double> QuasiNewton::direction(const MeasuredObjectiveOf<Scalar>& objective,
                                         const RowMatrix<double>& gradient) const {
  RowMatrix<double> q = gradient;
  std::vector<double> weights(pairs_.size());
  for (std::size_t i = pairs_.size(); i-- > 0;) {
    weights[i] = dot(pairs_[i].step, q) / pairs_[i].product;
    q -= weights[i] * pairs_[i].change;
  }
  q = objective.precondition(q);
  for (std::size_t i = 0; i < pairs_.size(); ++i)
    q += (weights[i] - dot(pairs_[i].change, q) / pairs_[i].product) * pairs_[i].step;
  return -q;
}

template <class Scalar>
QuasiNewtonReport QuasiNewton::minimise(const MeasuredObjectiveOf<Scalar>& objective,
                                        const QuasiNewtonOptions& options, RowMatrix<double>& c,
                                        Eigen::VectorX<Scalar>& u, const Progress& progress) {
  QuasiNewtonReport report;
  Trial<Scalar> now;
  if (u.size() == 0) objective.measure(c, u);
  now.u = u;
  now.value = objective.value(now.u, &now.cotangents);
  report.evaluations = 1;
  if (!std::isfinite(now.value)) throw Diverged("NaN or infinity in the energy at the start");
  gradient_ = objective.pull_back(now.cotangents);
  Eigen::VectorX<Scalar> du;
  while (report.iterations < options.iterations) {
    progress.report(static_cast<double>(report.iterations) / static_cast<double>(options.iterations));
    RowMatrix<double> step = direction(objective, gradient_);
    double slope = dot(gradient_, step);
    if (!(slope < 0.0)) {  // no descent direction: the pairs belong to another objective
      if (pairs_.empty()) break;
      forget();
      continue;
    }
    if (-0.5 * slope < options.tolerance * std::abs(now.value) + options.floor) {
      report.converged = true;
      break;
    }
    objective.measure(step, du);
    now.slope = slope;
    now.t = 0.0;
    Trial<Scalar> next = search_line(objective, now, du, report.evaluations);
    if (next.t == 0.0) {
      if (pairs_.empty()) break;
      forget();
      continue;
    }
    step *= next.t;
    c += step;
    RowMatrix<double> next_gradient = objective.pull_back(next.cotangents);
    Pair pair{step, next_gradient - gradient_, 0.0};
    pair.product = dot(pair.step, pair.change);
    if (pair.product > 1e-10 * std::sqrt(dot(pair.step, pair.step) * dot(pair.change, pair.change))) {
      pairs_.push_back(std::move(pair));
      if (pairs_.size() > history) pairs_.pop_front();
    }
    gradient_ = std::move(next_gradient);
    now = std::move(next);
    ++report.iterations;
    if (!objective.accepted(now.u)) {
      report.ended = true;
      break;
    }
  }
  report.value = now.value;
  u = std::move(now.u);
  return report;
}

#define ARAPFIELDS_MINIMISE(Scalar)                                                                       \
  template QuasiNewtonReport QuasiNewton::minimise<Scalar>(const MeasuredObjectiveOf<Scalar>&,            \
                                                           const QuasiNewtonOptions&, RowMatrix<double>&, \
                                                           Eigen::VectorX<Scalar>&, const Progress&);
ARAPFIELDS_MINIMISE(float)
ARAPFIELDS_MINIMISE(double)

}  // namespace arapfields
