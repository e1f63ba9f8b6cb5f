// SPDX-License-Identifier: GPL-3.0-or-later
#include "curve/deform_curve.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "energies/arap2d.h"
#include "optimize/quasi_newton.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Nodes of the grid over the points' bounding box and `margin` cells around it that are within `most_cells`
/// cells of a point.
std::vector<Vec2> grid_nodes(Points2In points, double spacing, double margin, double most_cells) {
  const Vec2 low = points.colwise().minCoeff().transpose(), high = points.colwise().maxCoeff().transpose();
  const Vec2 middle = 0.5 * (low + high);
  const auto steps = [&](int axis) {
    return static_cast<Index>(std::ceil(0.5 * (high - low)(axis) / spacing + margin));
  };
  std::vector<Vec2> nodes;
  for (Index i = -steps(0); i <= steps(0); ++i)
    for (Index j = -steps(1); j <= steps(1); ++j) {
      const Vec2 node = middle + spacing * Vec2(static_cast<double>(i), static_cast<double>(j));
      const double nearest = (points.rowwise() - node.transpose()).rowwise().squaredNorm().minCoeff();
      if (nearest <= most_cells * most_cells * spacing * spacing) nodes.push_back(node);
    }
  return nodes;
}

}  // namespace

RowMatrix<double> CurveBasis::rows(Points2In points) const {
  const Index n = points.rows(), m = centers.rows();
  RowMatrix<double> result = RowMatrix<double>::Zero(columns2 * n, size());
  parallel_for(0, n, 64, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      for (Index b = 0; b < m; ++b) {
        const Vec2 d = (points.row(p) - centers.row(b)).transpose();
        const double inverse = 1.0 / (radii(b) * radii(b));
        const double bump = std::exp(-d.squaredNorm() * inverse);
        result(p, b) = bump;
        for (int j = 0; j < 2; ++j) result((1 + j) * n + p, b) = -2 * inverse * d(j) * bump;
        for (int j = 0; j < 2; ++j)
          result((3 + j) * n + p, b) = (4 * inverse * inverse * d(j) * d(j) - 2 * inverse) * bump;
        result(5 * n + p, b) = 4 * inverse * inverse * d(0) * d(1) * bump;
      }
      result(p, m) = 1.0;
      for (int j = 0; j < 2; ++j) {
        result(p, m + 1 + j) = points(p, j);
        result((1 + j) * n + p, m + 1 + j) = 1.0;
      }
    }
  });
  return result;
}

CurveBasis curve_basis(Points2In points, double spacing) {
  const std::vector<Vec2> fine = grid_nodes(points, spacing, 1.0, 1.5);
  const std::vector<Vec2> coarse = grid_nodes(points, 3 * spacing, 1.0, 1e3);
  CurveBasis basis{Points2(static_cast<Index>(fine.size() + coarse.size()), 2),
                   Vector(static_cast<Index>(fine.size() + coarse.size()))};
  Index row = 0;
  const auto append = [&](const std::vector<Vec2>& nodes, double radius) {
    for (const Vec2& node : nodes) {
      basis.centers.row(row) = node;
      basis.radii(row++) = radius;
    }
  };
  append(fine, 2 * spacing);
  append(coarse, 6 * spacing);
  return basis;
}

CurveField CurveField::around(Points2In points, double spacing) {
  require(points.rows() > 0, "points", "none", "a curve needs samples");
  require(points.allFinite(), "points", "some are NaN or infinite", "all must be finite");
  const Vec2 low = points.colwise().minCoeff().transpose(), high = points.colwise().maxCoeff().transpose();
  CurveField field;
  field.center = 0.5 * (low + high);
  field.scale = 0.5 * (high - low).maxCoeff() / 0.75;
  require(field.scale > 0 && std::isfinite(field.scale), "points", "all are the same point",
          "a curve has an extent");
  field.basis = curve_basis(field.to_square(points), spacing);
  field.coefficients = RowMatrix<double>::Zero(field.basis.size(), 2);
  field.coefficients.bottomRows<2>().setIdentity();
  return field;
}

RowMatrix<double> CurveField::jets(Points2In points) const {
  const RowMatrix<double> rows = basis.rows(to_square(points));
  RowMatrix<double> result(rows.rows(), 2);
  gemm<double>(Transpose::no, Transpose::no, 1.0, rows, coefficients, 0.0, result);
  return result;
}

Points2 CurveField::operator()(Points2In points) const {
  Points2 result(points.rows(), 2);
  constexpr Index chunk = 4096;
  for (Index begin = 0; begin < points.rows(); begin += chunk) {
    const Index count = std::min<Index>(chunk, points.rows() - begin);
    result.middleRows(begin, count) = jets(points.middleRows(begin, count)).topRows(count);
  }
  return (result * scale).rowwise() + center.transpose();
}

namespace {

using Rows = RowMatrix<double>;

constexpr int local_global_steps = 8;
constexpr double gain_tolerance = 1e-5;
/// Rows that are multiplied between two checks of the task.
constexpr Index rows_at_once = 1024;
/// Matrices of the problem's size that exist at once while it is set up.
constexpr double copies = 2.0;

void check(const CurveHandle& handle, std::size_t position, Index samples) {
  const std::string name = "handles[" + std::to_string(position) + "]";
  handle.validate(name + ".");
  for (const Index s : handle.samples)
    require(s < samples, name, "sample " + std::to_string(s), "indices are below " + std::to_string(samples));
}

/// The deformation of one curve. What it measures of the coefficients: the jets at the samples, then the
/// second derivatives at the centers, scaled so that their squares add up to the smoothness term.
class CurveProblem final : public MeasuredObjective {
 public:
  CurveProblem(Points2In points, const std::vector<CurveHandle>& handles, const CurveOptions& options,
               const Progress& progress)
      : options_(options), count_(points.rows()), field_(CurveField::around(points, options.spacing)) {
    const double size = static_cast<double>(field_.basis.size());
    require_memory("spacing",
                   copies * sizeof(double) * size * (columns2 * static_cast<double>(count_) + 7.0 * size));
    progress.check();
    const Rows jets = field_.basis.rows(field_.to_square(points));
    const Index centers = field_.basis.centers.rows();
    Rows second = field_.basis.rows(field_.basis.centers).bottomRows(3 * centers);
    second.bottomRows(centers) *= std::sqrt(2.0);  // the mixed derivative counts twice in ‖D‖²
    rows_.resize(jets.rows() + second.rows(), field_.basis.size());
    rows_ << jets, std::sqrt(options.smoothness / static_cast<double>(centers)) * second;
    for (const CurveHandle& handle : handles) {
      const double share =
          options.handle_weight * handle.weight / static_cast<double>(handles.size() * handle.samples.size());
      for (const Index s : handle.samples) {
        const Vec2 moved = handle.motion.topLeftCorner<2, 2>() * points.row(s).transpose() +
                           handle.motion.topRightCorner<2, 1>();
        held_.push_back({s, share, field_.to_square(moved.transpose())});
      }
    }
    factorise(progress);
  }

  /// Minimises the quadratic surrogate for the rotations that are closest now.
  void local_global_step() {
    Rows jets;
    multiply(field_.coefficients, jets);
    Rows targets = Rows::Zero(rows_.rows(), 2);
    for (Index p = 0; p < count_; ++p) {
      Mat2 jacobian;
      for (int k = 0; k < 2; ++k) jacobian.col(k) = jets.row((1 + k) * count_ + p).transpose();
      const Mat2 rotation = closest_rotation2(jacobian);
      for (int k = 0; k < 2; ++k)
        targets.row((1 + k) * count_ + p) = rotation.col(k).transpose() / static_cast<double>(count_);
    }
    for (const Held& h : held_) targets.row(h.sample) += h.weight * h.target;
    field_.coefficients = cholesky_solve<double>(factor_, multiply_transposed(targets));
  }

  void measure(const Rows& coefficients, Vector& u) const override {
    Rows product;
    multiply(coefficients, product);
    u = Eigen::Map<const Vector>(product.data(), product.size());
  }

  double value(const Vector& u, Vector* cotangents) const override {
    const Eigen::Map<const Rows> measured(u.data(), rows_.rows(), 2);
    Rows out = Rows::Zero(rows_.rows(), 2);
    const Index tail = rows_.rows() - columns2 * count_;
    const ArapValue arap =
        arap_energy2<double>({u.data(), count_}, options_.bending, 1.0, {out.data(), count_});
    double total = arap.stretch + options_.bending * arap.bend + measured.bottomRows(tail).squaredNorm();
    out.bottomRows(tail) = 2 * measured.bottomRows(tail);
    for (const Held& h : held_) {
      const Eigen::RowVector2d gap = measured.row(h.sample) - h.target;
      total += h.weight * gap.squaredNorm();
      out.row(h.sample) += 2 * h.weight * gap;
    }
    if (cotangents != nullptr) *cotangents = Eigen::Map<const Vector>(out.data(), out.size());
    return total;
  }

  Rows pull_back(const Vector& cotangents) const override {
    return multiply_transposed(Eigen::Map<const Rows>(cotangents.data(), rows_.rows(), 2));
  }

  Rows precondition(const Rows& gradient) const override {
    return cholesky_solve<double>(factor_, 0.5 * gradient);
  }

  CurveField& field() { return field_; }

  CurveReport report() const {
    Rows jets;
    multiply(field_.coefficients, jets);
    CurveReport report;
    const ArapValue arap = arap_energy2<double>({jets.data(), count_}, 0.0, 1.0, {});
    report.stretch = arap.stretch;
    report.bend = arap.bend;
    for (const Held& h : held_) {
      const double gap = field_.scale * (jets.row(h.sample) - h.target).norm();
      report.handle_error_mean += gap / static_cast<double>(held_.size());
      report.handle_error_max = std::max(report.handle_error_max, gap);
    }
    const auto x = jets.middleRows(count_, count_).array(), y = jets.middleRows(2 * count_, count_).array();
    report.min_determinant = (x.col(0) * y.col(1) - x.col(1) * y.col(0)).minCoeff();
    return report;
  }

 private:
  struct Held {
    Index sample;
    double weight;
    Eigen::RowVector2d target;
  };

  /// Half the Hessian of the surrogate mean ‖J − R‖² + λ_bend mean ‖D‖² + handles + smoothness, R fixed.
  void factorise(const Progress& progress) {
    const double share = 1.0 / static_cast<double>(count_);
    const double weights[columns2] = {
        0.0, share, share, options_.bending * share, options_.bending * share, 2 * options_.bending * share};
    Vector weight = Vector::Ones(rows_.rows());
    for (int c = 0; c < columns2; ++c) weight.segment(c * count_, count_).setConstant(weights[c]);
    for (const Held& h : held_) weight(h.sample) += h.weight;
    Rows quadratic = Rows::Zero(rows_.cols(), rows_.cols());
    for (Index begin = 0; begin < rows_.rows(); begin += rows_at_once) {
      progress.check();
      const Rows block = rows_.middleRows(begin, std::min<Index>(rows_at_once, rows_.rows() - begin));
      const Rows scaled = weight.segment(begin, block.rows()).asDiagonal() * block;
      gemm<double>(Transpose::yes, Transpose::no, 1.0, block, scaled, 1.0, quadratic);
    }
    progress.check();
    quadratic.diagonal().array() += 1e-9 * quadratic.diagonal().mean();
    factor_ = cholesky<double>(quadratic);
  }
  void multiply(const Rows& coefficients, Rows& product) const {
    product.resize(rows_.rows(), 2);
    gemm<double>(Transpose::no, Transpose::no, 1.0, rows_, coefficients, 0.0, product);
  }
  Rows multiply_transposed(const Eigen::Ref<const Rows>& cotangents) const {
    Rows result(rows_.cols(), 2);
    gemm<double>(Transpose::yes, Transpose::no, 1.0, rows_, cotangents, 0.0, result);
    return result;
  }

  CurveOptions options_;
  Index count_;
  CurveField field_;
  Rows rows_;
  Rows factor_;
  std::vector<Held> held_;
};

}  // namespace

void CurveHandle::validate(const std::string& prefix) const {
  require(!samples.empty(), prefix + "samples", "there are none", "a handle holds one sample or more");
  for (const Index s : samples)
    require(s >= 0, prefix + "samples", std::to_string(s), "indices from 0 on are allowed");
  const Mat2 turn = motion.topLeftCorner<2, 2>();
  require(motion.allFinite() && (turn.transpose() * turn - Mat2::Identity()).norm() < 1e-6 &&
              turn.determinant() > 0 && (motion.row(2) - Eigen::RowVector3d(0, 0, 1)).norm() < 1e-9,
          prefix + "motion", "it is not finite, or scales, shears or mirrors",
          "a rotation and a translation (3, 3) are needed");
  require_positive(prefix + "weight", weight);
}

CurveSolution deform_curve(Points2In points, const std::vector<CurveHandle>& handles,
                           const CurveOptions& options, const Progress& progress) {
  options.validate();
  require(!handles.empty(), "handles", "none", "one or more are needed");
  for (std::size_t h = 0; h < handles.size(); ++h) check(handles[h], h, points.rows());
  const ThreadScope threads(options.threads);

  CurveProblem problem(points, handles, options, progress);
  for (int step = 0; step < local_global_steps; ++step) {
    progress.report(0.2 * step / local_global_steps, "rotations");
    problem.local_global_step();
  }
  QuasiNewton descent;
  const QuasiNewtonReport done = descent.minimise(problem, {options.iterations, gain_tolerance},
                                                  problem.field().coefficients, progress.part(0.2, 1.0));
  CurveSolution solution{problem.field(), problem.report()};
  solution.report.iterations = done.iterations;
  solution.report.loss = done.value;
  solution.report.converged = done.converged;
  return solution;
}

}  // namespace arapfields
