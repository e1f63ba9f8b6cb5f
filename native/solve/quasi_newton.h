// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <deque>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// A function of coefficients c (n,3) that sees them through linear measurements u = Φ c alone.
class MeasuredObjective {
 public:
  virtual ~MeasuredObjective() = default;
  /// u = Φ c.
  virtual void measure(const RowMatrix<double>& c, Vector& u) const = 0;
  /// The function's value; `cotangents`, unless null, is resized and becomes its derivative by u.
  virtual double value(const Vector& u, Vector* cotangents) const = 0;
  /// Φᵀ cotangents.
  virtual RowMatrix<double> pull_back(const Vector& cotangents) const = 0;
  /// An approximation of the inverse Hessian, times a gradient.
  virtual RowMatrix<double> precondition(const RowMatrix<double>& gradient) const = 0;
};

struct QuasiNewtonOptions {
  Index steps = 12;         ///< at most so many
  double tolerance = 1e-4;  ///< stops where a step is expected to gain less than this share of the value
};

struct QuasiNewtonReport {
  Index steps = 0;
  Index evaluations = 0;
  double value = 0.0;
  bool converged = false;
};

/// Preconditioned L-BFGS. A line search costs no product with Φ, since u is linear in the step. Every
/// accepted step lowers the value. The pairs of past steps serve the next call too, until forget().
class QuasiNewton {
 public:
  /// Improves c in place. Throws Diverged where the value at the start is not finite.
  QuasiNewtonReport minimise(const MeasuredObjective& objective, const QuasiNewtonOptions& options,
                             RowMatrix<double>& c, const Progress& progress = {});
  void forget() { pairs_.clear(); }

 private:
  struct Pair {
    RowMatrix<double> step, change;
    double product;
  };
  RowMatrix<double> direction(const MeasuredObjective& objective, const RowMatrix<double>& gradient) const;

  std::deque<Pair> pairs_;
};

}  // namespace arapfields
