// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <deque>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// A function of coefficients c (n,3) that depends on them through linear measurements u = Φ c alone.
template <class Scalar>
class MeasuredObjectiveOf {
 public:
  virtual ~MeasuredObjectiveOf() = default;
  /// u = Φ c.
  virtual void measure(const RowMatrix<double>& c, Eigen::VectorX<Scalar>& u) const = 0;
  /// The function's value; `cotangents`, unless null, is resized and becomes its derivative by u.
  virtual double value(const Eigen::VectorX<Scalar>& u, Eigen::VectorX<Scalar>* cotangents) const = 0;
  /// Φᵀ cotangents.
  virtual RowMatrix<double> pull_back(const Eigen::VectorX<Scalar>& cotangents) const = 0;
  /// An approximation of the inverse Hessian, times a gradient.
  virtual RowMatrix<double> precondition(const RowMatrix<double>& gradient) const = 0;
  /// First trial step length of the line search from u along du; `slope` is the directional derivative.
  virtual double first_trial(const Eigen::VectorX<Scalar>& u, const Eigen::VectorX<Scalar>& du,
                             double slope) const {
    static_cast<void>(u), static_cast<void>(du), static_cast<void>(slope);
    return 1.0;
  }
  /// After each accepted step: false ends the descent there.
  virtual bool accepted(const Eigen::VectorX<Scalar>& u) const {
    static_cast<void>(u);
    return true;
  }
};

using MeasuredObjective = MeasuredObjectiveOf<double>;

struct QuasiNewtonOptions {
  Index iterations;         ///< most iterations
  double tolerance = 1e-4;  ///< converged if the predicted decrease is below this fraction of the value
  double floor = 1e-18;     ///< or below this
};

struct QuasiNewtonReport {
  Index iterations = 0;
  Index evaluations = 0;
  double value = 0.0;
  bool converged = false;
  bool ended = false;  ///< accepted() returned false
};

/// Preconditioned L-BFGS. A line search costs no product with Φ, since u is linear in the step. Every
/// accepted step decreases the value. The quasi-Newton pairs are kept for the next call, until forget().
class QuasiNewton {
 public:
  /// Minimises over c in place, and updates its measurements u (empty: they are computed). Throws Diverged if
  /// the value at the start is not finite.
  template <class Scalar>
  QuasiNewtonReport minimise(const MeasuredObjectiveOf<Scalar>& objective, const QuasiNewtonOptions& options,
                             RowMatrix<double>& c, Eigen::VectorX<Scalar>& u, const Progress& progress = {});
  QuasiNewtonReport minimise(const MeasuredObjective& objective, const QuasiNewtonOptions& options,
                             RowMatrix<double>& c, const Progress& progress = {}) {
    Vector u;
    return minimise(objective, options, c, u, progress);
  }
  void forget() { pairs_.clear(); }
  /// The gradient at the end of the last call.
  const RowMatrix<double>& gradient() const { return gradient_; }

 private:
  struct Pair {
    RowMatrix<double> step, change;
    double product;
  };
  template <class Scalar>
  RowMatrix<double> direction(const MeasuredObjectiveOf<Scalar>& objective,
                              const RowMatrix<double>& gradient) const;

  std::deque<Pair> pairs_;
  RowMatrix<double> gradient_;
};

}  // namespace arapfields
