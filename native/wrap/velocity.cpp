// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/velocity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "energies/rotation.h"
#include "fields/radial_evaluator.h"
#include "tensors/dense.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

using namespace wrap_parameters;

constexpr Index block_size = 16;

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// The contribution of a block of 16 neighbouring points to the normal equations, for the basis functions
/// whose support it meets.
template <typename Scalar>
struct PointBlock {
  using Matrix = RowMatrix<Scalar>;

  std::vector<Index> functions;  // ascending
  Matrix values;                 // (functions, points)
  Matrix gradients;              // (functions, 6 points): weighted, along the columns of J and along the axes
  Matrix right_hand_side;        // (functions, 3)
  Eigen::Matrix<Scalar, block_size, 6> forms;

  PointBlock(const RadialBlock<double>& block, Index first, Index centers, const MotionStiffness& stiffness,
             const CorrespondenceTerms& correspondences) {
    const Index count = block.active_count, all = count + 4;
    functions.assign(block.active, block.active + count);
    for (Index k = 0; k < 4; ++k) functions.push_back(centers + k);
    values.setZero(all, block_size);
    gradients.setZero(all, 6 * block_size);
    right_hand_side.setZero(all, 3);
    forms.setZero();

    std::vector<double> rows(count * 4 * block_size);
    ARAPFIELDS_DISPATCH(radial_rows(block, 4, rows.data()));
    const auto row = [&](Index a, int c, Index p) {
      return static_cast<Scalar>(rows[(a * 4 + c) * block_size + p]);
    };
    Matrix slopes = Matrix::Zero(all, 3);  // derivatives of the basis functions at one point
    slopes.bottomRows(3).setIdentity();
    const Index valid = std::min<Index>(block_size, stiffness.points.rows() - first);
    for (Index p = 0; p < valid; ++p) {
      const Index i = first + p;
      for (Index a = 0; a < count; ++a) {
        values(a, p) = row(a, 0, p);
        for (int k = 0; k < 3; ++k) slopes(a, k) = row(a, 1 + k, p);
      }
      values(count, p) = 1;
      values.col(p).template tail<3>() = stiffness.points.row(i).transpose().template cast<Scalar>();
      forms.row(p) = correspondences.forms.row(i).template cast<Scalar>();
      right_hand_side.noalias() +=
          values.col(p) * correspondences.right_hand_sides.row(i).template cast<Scalar>();
      const Mat3 jacobian = Eigen::Map<const RowMat3>(&stiffness.jacobians(i, 0));
      add_stiffness(p, closest_rotation(jacobian) - jacobian,
                    stiffness.at_rest ? slopes : Matrix(slopes * jacobian.template cast<Scalar>()),
                    static_cast<Scalar>(stiffness.rigidity[i]), static_cast<Scalar>(stiffness.viscosity[i]),
                    slopes);
    }
  }

 private:
  void add_stiffness(Index p, const Mat3& missing, const Matrix& along, Scalar rigidity, Scalar viscosity,
                     const Matrix& slopes) {
    right_hand_side.noalias() += rigidity * along * missing.template cast<Scalar>().transpose();
    for (int k = 0; k < 3; ++k) {
      gradients.col(k * block_size + p) = std::sqrt(rigidity) * along.col(k);
      gradients.col((3 + k) * block_size + p) = std::sqrt(viscosity) * slopes.col(k);
    }
  }
};

template <typename Scalar>
std::vector<PointBlock<Scalar>> point_blocks(const RadialBasis& basis, const MotionStiffness& stiffness,
                                             const CorrespondenceTerms& correspondences) {
  const RadialEvaluator<double> field(basis, stiffness.points, JetOrder::first);
  std::vector<std::optional<PointBlock<Scalar>>> blocks(field.blocks());
  parallel_for(0, field.blocks(), 4, [&](Index first, Index last) {
    for (Index b = first; b < last; ++b)
      blocks[b].emplace(field.block(b), b * block_size, basis.center_count(), stiffness, correspondences);
  });
  std::vector<PointBlock<Scalar>> result;
  for (auto& block : blocks) result.push_back(std::move(*block));
  return result;
}

/// The lower triangle (size, size) of the matrix that all coordinates share (entry −1: stiffness), or that
/// couples two of them (0 to 5: xx, yy, zz, xy, xz, yz: correspondences).
template <typename Scalar>
RowMatrix<double> matrix_of(const std::vector<PointBlock<Scalar>>& blocks, Index size, int entry,
                            const Progress& progress) {
  RowMatrix<double> sum = RowMatrix<double>::Zero(size, size);
  RowMatrix<Scalar> product, scaled;
  for (const PointBlock<Scalar>& block : blocks) {
    if (progress.cancelled()) break;
    const auto count = static_cast<Index>(block.functions.size());
    product.resize(count, count);
    if (entry < 0) {
      lower_gram<Scalar>(Transpose::no, block.gradients, 0, product);
    } else {
      scaled = block.values * block.forms.col(entry).asDiagonal();
      gemm<Scalar>(Transpose::no, Transpose::yes, 1, scaled, block.values, 0, product);
    }
    for (Index i = 0; i < count; ++i) {
      double* row = &sum(block.functions[i], 0);
      for (Index j = 0; j <= i; ++j) row[block.functions[j]] += static_cast<double>(product(i, j));
    }
  }
  return sum;
}

template <typename Scalar>
RowMatrix<double> right_hand_side_of(const std::vector<PointBlock<Scalar>>& blocks, Index size) {
  RowMatrix<double> sum = RowMatrix<double>::Zero(size, 3);
  for (const PointBlock<Scalar>& block : blocks)
    for (std::size_t i = 0; i < block.functions.size(); ++i)
      sum.row(block.functions[i]) += block.right_hand_side.row(i).template cast<double>();
  return sum;
}

/// Adds a symmetric matrix, given by its lower triangle, to a block of a larger one.
void add_block(const RowMatrix<double>& lower, int row, int column, RowMatrix<double>& matrix) {
  const Index size = lower.rows();
  parallel_for(0, size, 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < (row == column ? i + 1 : size); ++j)
        matrix(row * size + i, column * size + j) += j <= i ? lower(i, j) : lower(j, i);
  });
}

RowMatrix<double> regularized_cholesky(RowMatrix<double>& matrix) {
  double added = regularization * matrix.diagonal().mean();
  for (int attempt = 0;; ++attempt) {
    matrix.diagonal().array() += added;
    try {
      return cholesky<double>(matrix);
    } catch (const InvalidInput&) {
      if (attempt == regularization_retries) throw;
    }
    added *= regularization_growth;
  }
}

/// solve_velocity() with products of this precision.
template <typename Scalar>
RowMatrix<double> solution_of(const RadialBasis& basis, const MotionStiffness& stiffness,
                              const CorrespondenceTerms& correspondences, const LandmarkTerm& landmarks,
                              const Progress& progress) {
  constexpr int entry_of[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
  const Index size = basis.size();

  // Terms of the surface's points.
  const std::vector<PointBlock<Scalar>> blocks = point_blocks<Scalar>(basis, stiffness, correspondences);
  progress.check();
  std::array<RowMatrix<double>, 7> matrices;  // the first is shared by the coordinates
  parallel_jobs(
      7, [&](Index job) { matrices[job] = matrix_of(blocks, size, static_cast<int>(job) - 1, progress); });
  progress.check();
  RowMatrix<double>& shared = matrices[0];
  RowMatrix<double> columns = right_hand_side_of(blocks, size);

  // Ridge and landmarks, which act on each coordinate alone.
  shared.diagonal().head(basis.center_count()).array() += stiffness.ridge;
  if (landmarks.points.rows() > 0) {
    const RowMatrix<double> rows = radial_rows(basis, landmarks.points, JetOrder::value);
    const double weight = landmarks.weight / static_cast<double>(rows.rows());
    shared += weight * rows.transpose() * rows;
    columns += weight * rows.transpose() * landmarks.displacements;
  }

  // One system for all coordinates.
  RowMatrix<double> matrix = RowMatrix<double>::Zero(3 * size, 3 * size), right_hand_side(3 * size, 1);
  for (int q = 0; q < 3; ++q) {
    add_block(shared, q, q, matrix);
    for (int r = 0; r <= q; ++r) add_block(matrices[1 + entry_of[q][r]], q, r, matrix);
    right_hand_side.middleRows(q * size, size) = columns.col(q);
  }
  progress.check();
  const RowMatrix<double> solution = cholesky_solve<double>(regularized_cholesky(matrix), right_hand_side);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>>(solution.data(), size, 3);
}

}  // namespace

RowMatrix<double> solve_velocity(const RadialBasis& basis, const MotionStiffness& stiffness,
                                 const CorrespondenceTerms& correspondences, const LandmarkTerm& landmarks,
                                 const Progress& progress) {
  // The weights of held points, relative to stiffness, exceed what single precision resolves.
  return stiffness.at_rest ? solution_of<double>(basis, stiffness, correspondences, landmarks, progress)
                           : solution_of<float>(basis, stiffness, correspondences, landmarks, progress);
}

}  // namespace arapfields
