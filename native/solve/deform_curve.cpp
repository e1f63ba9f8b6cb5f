// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/deform_curve.h"

#include <Eigen/LU>
#include <cmath>

#include "core/dense.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "energies/arap2d.h"
#include "solve/lbfgs.h"

namespace arapfields {
namespace {

using Rows = RowMatrix<double>;

constexpr int local_global_steps = 8;
constexpr double gain_tolerance = 1e-6;

void check(const CurveOptions& options) {
  const auto positive = [](const char* name, double value) {
    require(std::isfinite(value) && value > 0, name, std::to_string(value), "must be positive");
  };
  const auto not_negative = [](const char* name, double value) {
    require(std::isfinite(value) && value >= 0, name, std::to_string(value), "must be 0 or more");
  };
  not_negative("bending", options.bending);
  not_negative("smoothness", options.smoothness);
  positive("handle_weight", options.handle_weight);
  require(options.iterations >= 0, "iterations", std::to_string(options.iterations), "must be 0 or more");
  positive("spacing", options.spacing);
  require(options.spacing >= 0.01 && options.spacing <= 1, "spacing", std::to_string(options.spacing),
          "must be in [0.01, 1]");
}

void check(const CurveHandle& handle, std::size_t position, Index samples) {
  const std::string name = "handles[" + std::to_string(position) + "]";
  require(!handle.samples.empty(), name, "no samples", "a handle holds one sample or more");
  for (const Index s : handle.samples)
    require(s >= 0 && s < samples, name, "sample " + std::to_string(s),
            "indices are below " + std::to_string(samples));
  const Mat2 turn = handle.motion.topLeftCorner<2, 2>();
  require(handle.motion.allFinite() && (turn.transpose() * turn - Mat2::Identity()).norm() < 1e-6 &&
              turn.determinant() > 0 && (handle.motion.row(2) - Eigen::RowVector3d(0, 0, 1)).norm() < 1e-9,
          name, "the motion scales, shears or mirrors", "a rotation and a translation (3, 3) are needed");
  require(std::isfinite(handle.weight) && handle.weight > 0, name, "weight " + std::to_string(handle.weight),
          "must be positive");
}

/// The deformation of one curve: basis rows at its samples, targets, and the factor of the linear problem.
class CurveProblem {
 public:
  CurveProblem(Points2In points, const std::vector<CurveHandle>& handles, const CurveOptions& options)
      : options_(options),
        count_(points.rows()),
        field_(CurveField::around(points, options.spacing)),
        rows_(field_.basis.rows(field_.to_square(points))) {
    for (const CurveHandle& handle : handles) {
      const double share =
          options.handle_weight * handle.weight / static_cast<double>(handles.size() * handle.samples.size());
      for (const Index s : handle.samples) {
        const Vec2 moved = handle.motion.topLeftCorner<2, 2>() * points.row(s).transpose() +
                           handle.motion.topRightCorner<2, 1>();
        held_.push_back({s, share, field_.to_square(moved.transpose())});
      }
    }
    smooth_ = Rows::Zero(size(), size());
    add_second(smooth_, field_.basis.rows(field_.basis.centers), options.smoothness);
    Rows quadratic = smooth_;
    for (int c = 1; c <= 2; ++c) add_square(quadratic, rows_, c, 1);
    add_second(quadratic, rows_, options.bending);
    for (const Held& h : held_) quadratic += h.weight * rows_.row(h.sample).transpose() * rows_.row(h.sample);
    quadratic.diagonal().array() += 1e-9 * quadratic.diagonal().mean();
    factor_ = cholesky<double>(quadratic);
  }

  /// Minimises the quadratic surrogate for the rotations that are closest now.
  void local_global_step() {
    const Rows jets = evaluate(field_.coefficients);
    Rows wanted = Rows::Zero(rows_.rows(), 2);
    for (Index p = 0; p < count_; ++p) {
      Mat2 jacobian;
      for (int k = 0; k < 2; ++k) jacobian.col(k) = jets.row((1 + k) * count_ + p).transpose();
      const Mat2 rotation = closest_rotation2(jacobian);
      for (int k = 0; k < 2; ++k)
        wanted.row((1 + k) * count_ + p) = rotation.col(k).transpose() / static_cast<double>(count_);
    }
    for (const Held& h : held_) wanted.row(h.sample) += h.weight * h.target;
    field_.coefficients = cholesky_solve<double>(factor_, pull_back(wanted));
  }

  double energy(const Rows& coefficients, Rows& gradient) const {
    const Rows jets = evaluate(coefficients);
    Rows cotangents = Rows::Zero(jets.rows(), 2);
    const ArapValue arap =
        arap_energy2<double>({jets.data(), count_}, options_.bending, 1.0, {cotangents.data(), count_});
    double value = arap.stretch + options_.bending * arap.bend;
    for (const Held& h : held_) {
      const Eigen::RowVector2d gap = jets.row(h.sample) - h.target;
      value += h.weight * gap.squaredNorm();
      cotangents.row(h.sample) += 2 * h.weight * gap;
    }
    const Rows pull = smooth_ * coefficients;
    value += pull.cwiseProduct(coefficients).sum();
    gradient = pull_back(cotangents) + 2 * pull;
    return value;
  }

  Rows precondition(const Rows& direction) const { return cholesky_solve<double>(factor_, 0.5 * direction); }

  CurveField& field() { return field_; }

  void finish(CurveReport& report) const {
    const Rows jets = evaluate(field_.coefficients);
    const ArapValue arap = arap_energy2<double>({jets.data(), count_}, 0.0, 1.0, {});
    report.stretch = arap.stretch;
    report.bend = arap.bend;
    for (const Held& h : held_) {
      const double gap = field_.scale * (jets.row(h.sample) - h.target).norm();
      report.handle_error_mean += gap / static_cast<double>(held_.size());
      report.handle_error_max = std::max(report.handle_error_max, gap);
    }
    report.min_determinant =
        (jets.middleRows(count_, count_).col(0).array() * jets.middleRows(2 * count_, count_).col(1).array() -
         jets.middleRows(count_, count_).col(1).array() * jets.middleRows(2 * count_, count_).col(0).array())
            .minCoeff();
  }

 private:
  struct Held {
    Index sample;
    double weight;
    Eigen::RowVector2d target;
  };

  Index size() const { return field_.basis.size(); }

  /// Adds the quadratic form of weight times the mean square of one jet column.
  static void add_square(Rows& quadratic, const Rows& rows, int column, double weight) {
    const Index n = rows.rows() / columns2;
    const auto block = rows.middleRows(column * n, n);
    gemm<double>(Transpose::yes, Transpose::no, weight / static_cast<double>(n), block, block, 1.0,
                 quadratic);
  }
  /// The same for all second derivatives, ‖D‖².
  static void add_second(Rows& quadratic, const Rows& rows, double weight) {
    for (int c = 3; c < columns2; ++c) add_square(quadratic, rows, c, c == 5 ? 2 * weight : weight);
  }
  Rows evaluate(const Rows& coefficients) const {
    Rows jets(rows_.rows(), 2);
    gemm<double>(Transpose::no, Transpose::no, 1.0, rows_, coefficients, 0.0, jets);
    return jets;
  }
  Rows pull_back(const Rows& cotangents) const {
    Rows result(size(), 2);
    gemm<double>(Transpose::yes, Transpose::no, 1.0, rows_, cotangents, 0.0, result);
    return result;
  }

  CurveOptions options_;
  Index count_;
  CurveField field_;
  Rows rows_;
  Rows smooth_;  // quadratic form of the smoothness
  Rows factor_;
  std::vector<Held> held_;
};

}  // namespace

CurveSolution deform_curve(Points2In points, const std::vector<CurveHandle>& handles,
                           const CurveOptions& options, const Progress& progress) {
  check(options);
  require(!handles.empty(), "handles", "none", "one or more are needed");
  for (std::size_t h = 0; h < handles.size(); ++h) check(handles[h], h, points.rows());
  const ThreadScope threads(options.threads);

  CurveProblem problem(points, handles, options);
  for (int step = 0; step < local_global_steps; ++step) {
    progress.report(0.2 * step / local_global_steps, "rotations");
    problem.local_global_step();
  }
  CurveSolution solution;
  minimise_lbfgs<Rows>(
      problem.field().coefficients, options.iterations, gain_tolerance,
      [&](const Rows& x, Rows& gradient) {
        progress.check();
        return problem.energy(x, gradient);
      },
      [&](const Rows& direction) { return problem.precondition(direction); },
      [&](int step, double value) {
        solution.report.energies.push_back(value);
        progress.report(0.2 + 0.8 * step / options.iterations, "quasi-Newton");
      });
  problem.finish(solution.report);
  solution.field = problem.field();
  return solution;
}

}  // namespace arapfields
