// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/system.h"

#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <vector>

#include "core/dense.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "fields/radial_evaluator.h"

namespace arapfields {
namespace {

constexpr Index block_size = 16;
/// Of the trace's mean, added to the diagonal, and how often it is raised where rounding has its way.
constexpr double rounding = 1e-9, rounding_growth = 100.0;
constexpr int rounding_tries = 4;
using Block = RowMatrix<float>;

Mat3 closest_rotation(const Mat3& matrix) {
  const Eigen::JacobiSVD<Mat3> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) *= -1.0;
  return u * svd.matrixV().transpose();
}

/// What a block of neighbouring places adds to the sums, by the functions that they feel.
struct Piece {
  std::vector<Index> functions;  // ascending
  Block values;                  // (functions, places)
  Block slopes;  // (functions, 6 places): weighted derivatives along columns of J, and along axes
  Block asked;   // (functions, 3)
  Eigen::Matrix<float, block_size, 6> forms;
};

class Assembly {
 public:
  Assembly(const RadialBasis& basis, const WrapMotion& motion, const WrapForces& forces);

  /// (size, size) what all coordinates share (−1) or what couples them (0 to 5: xx, yy, zz, xy, xz, yz); the
  /// lower triangle.
  RowMatrix<double> products(int which, const Progress& progress) const;
  RowMatrix<double> asked() const;

 private:
  Piece piece(Index b, const RadialEvaluator<double>& field, const WrapMotion& motion,
              const WrapForces& forces) const;
  void add_slopes(Index p, const Mat3& jacobian, float rigid, float viscous, const Block& slopes,
                  Piece& piece) const;

  Index centers_;
  std::vector<Piece> pieces_;
};

Assembly::Assembly(const RadialBasis& basis, const WrapMotion& motion, const WrapForces& forces)
    : centers_(basis.center_count()) {
  const RadialEvaluator<double> field(basis, motion.places, JetOrder::first);
  pieces_.resize(static_cast<std::size_t>(field.blocks()));
  parallel_for(0, field.blocks(), 4, [&](Index first, Index last) {
    for (Index b = first; b < last; ++b)
      pieces_[static_cast<std::size_t>(b)] = piece(b, field, motion, forces);
  });
}

/// `slopes` (functions, 3) of one place.
void Assembly::add_slopes(Index p, const Mat3& jacobian, float rigid, float viscous, const Block& slopes,
                          Piece& piece) const {
  const Eigen::Matrix3f missing = (closest_rotation(jacobian) - jacobian).cast<float>();
  const Block along = slopes * jacobian.cast<float>();
  piece.asked.noalias() += rigid * along * missing.transpose();
  for (int k = 0; k < 3; ++k) {
    piece.slopes.col(k * block_size + p) = std::sqrt(rigid) * along.col(k);
    piece.slopes.col((3 + k) * block_size + p) = std::sqrt(viscous) * slopes.col(k);
  }
}

Piece Assembly::piece(Index b, const RadialEvaluator<double>& field, const WrapMotion& motion,
                      const WrapForces& forces) const {
  const RadialBlock<double> block = field.block(b);
  const Index count = block.active_count, all = count + 4, first = b * block_size,
              left = motion.places.rows() - first, valid = std::min<Index>(block_size, left);
  Piece piece;
  piece.functions.assign(block.active, block.active + count);
  for (Index k = 0; k < 4; ++k) piece.functions.push_back(centers_ + k);
  std::vector<double> rows(static_cast<std::size_t>(count * 4 * block_size));
  ARAPFIELDS_DISPATCH(radial_rows(block, 4, rows.data()));
  const auto row = [&](Index a, int c, Index p) {
    return static_cast<float>(rows[static_cast<std::size_t>((a * 4 + c) * block_size + p)]);
  };
  piece.values.setZero(all, block_size);
  piece.slopes.setZero(all, 6 * block_size);
  piece.asked.setZero(all, 3);
  piece.forms.setZero();
  Block slopes = Block::Zero(all, 3);
  slopes.bottomRows(3).setIdentity();
  for (Index p = 0; p < valid; ++p) {
    const Index i = first + p;
    for (Index a = 0; a < count; ++a) {
      piece.values(a, p) = row(a, 0, p);
      for (int k = 0; k < 3; ++k) slopes(a, k) = row(a, 1 + k, p);
    }
    piece.values(count, p) = 1.0F;
    piece.values.col(p).tail<3>() = motion.places.row(i).transpose().cast<float>();
    piece.forms.row(p) = forces.forms.row(i).cast<float>();
    piece.asked.noalias() += piece.values.col(p) * forces.pulls.row(i).cast<float>();
    const Mat3 jacobian =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&motion.jacobians(i, 0));
    add_slopes(p, jacobian, static_cast<float>(motion.rigid[i]), static_cast<float>(motion.viscous[i]),
               slopes, piece);
  }
  return piece;
}

RowMatrix<double> Assembly::products(int which, const Progress& progress) const {
  RowMatrix<double> sum = RowMatrix<double>::Zero(centers_ + 4, centers_ + 4);
  Block product, scaled;
  for (const Piece& piece : pieces_) {
    if (progress.cancelled()) break;
    const auto size = static_cast<Index>(piece.functions.size());
    product.resize(size, size);
    if (which < 0) {
      lower_gram<float>(Transpose::no, piece.slopes, 0.0F, product);
    } else {
      scaled = piece.values * piece.forms.col(which).asDiagonal();
      gemm<float>(Transpose::no, Transpose::yes, 1.0F, scaled, piece.values, 0.0F, product);
    }
    for (Index i = 0; i < size; ++i) {
      double* row = &sum(piece.functions[static_cast<std::size_t>(i)], 0);
      for (Index j = 0; j <= i; ++j)
        row[piece.functions[static_cast<std::size_t>(j)]] += static_cast<double>(product(i, j));
    }
  }
  return sum;
}

RowMatrix<double> Assembly::asked() const {
  RowMatrix<double> sum = RowMatrix<double>::Zero(centers_ + 4, 3);
  for (const Piece& piece : pieces_)
    for (std::size_t i = 0; i < piece.functions.size(); ++i)
      sum.row(piece.functions[i]) += piece.asked.row(static_cast<Index>(i)).cast<double>();
  return sum;
}

/// Adds a symmetric matrix, of which the lower triangle is known, to a block of the whole.
void add_block(const RowMatrix<double>& lower, int row, int column, RowMatrix<double>& whole) {
  const Index size = lower.rows();
  parallel_for(0, size, 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      for (Index j = 0; j < (row == column ? i + 1 : size); ++j)
        whole(row * size + i, column * size + j) += j <= i ? lower(i, j) : lower(j, i);
  });
}

RowMatrix<double> factor_of(RowMatrix<double>& matrix) {
  double added = rounding * matrix.diagonal().mean();
  for (int attempt = 0;; ++attempt) {
    matrix.diagonal().array() += added;
    try {
      return cholesky<double>(matrix);
    } catch (const InvalidInput&) {
      if (attempt == rounding_tries) throw;
    }
    added *= rounding_growth;
  }
}

}  // namespace

RowMatrix<double> solve_velocity(const RadialBasis& basis, const WrapMotion& motion, const WrapForces& forces,
                                 const WrapMarks& marks, const Progress& progress) {
  constexpr int coupled_of[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
  const Index size = basis.size();
  const Assembly assembly(basis, motion, forces);
  progress.check();
  std::array<RowMatrix<double>, 7> products;  // the first is what the coordinates share
  parallel_jobs(7, [&](Index job) {
    products[static_cast<std::size_t>(job)] = assembly.products(static_cast<int>(job) - 1, progress);
  });
  progress.check();
  RowMatrix<double>& shared = products[0];
  RowMatrix<double> asked_of = assembly.asked();
  shared.diagonal().head(basis.center_count()).array() += motion.ridge;
  if (marks.places.rows() > 0) {
    const RowMatrix<double> rows = radial_rows(basis, marks.places, JetOrder::value);
    const double weight = marks.weight / static_cast<double>(rows.rows());
    shared += weight * rows.transpose() * rows;
    asked_of += weight * rows.transpose() * marks.ways;
  }
  RowMatrix<double> matrix = RowMatrix<double>::Zero(3 * size, 3 * size), asked(3 * size, 1);
  for (int q = 0; q < 3; ++q) {
    add_block(shared, q, q, matrix);
    for (int r = 0; r <= q; ++r)
      add_block(products[static_cast<std::size_t>(1 + coupled_of[q][r])], q, r, matrix);
    asked.middleRows(q * size, size) = asked_of.col(q);
  }
  progress.check();
  const RowMatrix<double> found = cholesky_solve<double>(factor_of(matrix), asked);
  RowMatrix<double> result(size, 3);
  for (int q = 0; q < 3; ++q) result.col(q) = found.middleRows(q * size, size);
  return result;
}

}  // namespace arapfields
