// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <deque>
#include <functional>

#include "core/types.h"

namespace arapfields {

/// Limited-memory quasi-Newton descent (Nocedal and Wright, Numerical Optimization, algorithm 7.4) from `x`,
/// which is overwritten. `energy(x, gradient)` returns the value and overwrites the gradient; `precondition`
/// multiplies by an approximate inverse Hessian; `accept(step, value)` follows every step and may throw.
/// Steps are halved until Armijo's condition holds. It ends after `steps`, when no step descends, or when two
/// steps in a row gain less than `tolerance` of the value. Returns the value reached.
template <class Matrix>
double minimise_lbfgs(Matrix& x, int steps, double tolerance,
                      const std::function<double(const Matrix&, Matrix&)>& energy,
                      const std::function<Matrix(const Matrix&)>& precondition,
                      const std::function<void(int, double)>& accept, std::size_t memory = 12) {
  struct Pair {
    Matrix step, change;
    double curvature;
  };
  const auto dot = [](const Matrix& a, const Matrix& b) { return a.cwiseProduct(b).sum(); };
  std::deque<Pair> pairs;
  Matrix gradient(x.rows(), x.cols()), next_gradient(x.rows(), x.cols());
  double value = energy(x, gradient);
  int idle = 0;
  for (int step = 1; step <= steps && idle < 2; ++step) {
    Matrix direction = -gradient;
    std::deque<double> shares;
    for (auto pair = pairs.rbegin(); pair != pairs.rend(); ++pair) {
      shares.push_front(dot(pair->step, direction) / pair->curvature);
      direction -= shares.front() * pair->change;
    }
    direction = precondition(direction);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const double share = dot(pairs[i].change, direction) / pairs[i].curvature;
      direction += (shares[i] - share) * pairs[i].step;
    }
    const double slope = dot(gradient, direction);
    double length = 1.0, next_value = value;
    Matrix next;
    bool descended = false;
    for (int halvings = 0; halvings < 30 && slope < 0 && !descended; ++halvings, length *= 0.5) {
      next = x + length * direction;
      next_value = energy(next, next_gradient);
      descended = next_value <= value + 1e-4 * length * slope;
    }
    if (!descended) {
      if (pairs.empty()) break;
      pairs.clear();  // start over from the preconditioner alone
      continue;
    }
    Pair pair{next - x, next_gradient - gradient, 0.0};
    pair.curvature = dot(pair.step, pair.change);
    if (pair.curvature > 1e-12 * pair.step.norm() * pair.change.norm()) {
      pairs.push_back(std::move(pair));
      if (pairs.size() > memory) pairs.pop_front();
    }
    idle = value - next_value < tolerance * value ? idle + 1 : 0;
    x.swap(next);
    gradient.swap(next_gradient);
    value = next_value;
    accept(step, value);
  }
  return value;
}

}  // namespace arapfields
