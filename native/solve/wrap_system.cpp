// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/wrap_system.h"

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
/// Parts that are summed on their own: the result does not depend on the number of threads.
constexpr Index parts = 4;
/// Of the trace's mean, added to the diagonal, and how often it is raised where rounding has its way.
constexpr double rounding = 1e-9, rounding_growth = 100.0;
constexpr int rounding_tries = 4;
/// Numbers of a block's functions: values, derivatives, derivatives along the columns of J.
constexpr int kinds = 7;
using Block = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Mat3 closest_rotation(const Mat3& matrix) {
  const Eigen::JacobiSVD<Mat3> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) *= -1.0;
  return u * svd.matrixV().transpose();
}

/// Sums over some of the points: what the coordinates share, what couples them, and what is asked for.
struct Sums {
  RowMatrix<double> shared;                  // (size, size), lower triangle
  std::array<RowMatrix<double>, 6> coupled;  // the same for xx, yy, zz, xy, xz, yz
  RowMatrix<double> asked;                   // (size, 3)

  explicit Sums(Index size) : shared(RowMatrix<double>::Zero(size, size)) {
    coupled.fill(shared);
    asked.setZero(size, 3);
  }
};

class Assembly {
 public:
  Assembly(const RadialBasis& basis, const WrapMotion& motion, const WrapForces& forces)
      : basis_(basis), motion_(motion), forces_(forces), field_(basis, motion.places, JetOrder::first) {}

  std::vector<Sums> sums(const Progress& progress) const {
    std::vector<Sums> result(parts, Sums(basis_.size()));
    parallel_for(0, parts, 1, [&](Index first, Index last) {
      for (Index part = first; part < last; ++part)
        for (Index b = part; b < field_.blocks() && !progress.cancelled(); b += parts)
          add(b, result[static_cast<std::size_t>(part)]);
    });
    progress.check();
    return result;
  }

 private:
  /// (functions, points) of one kind after the other; the four affine functions come last.
  std::array<Block, kinds> functions(Index b, const RadialBlock<double>& block) const;
  void add(Index b, Sums& sums) const;

  const RadialBasis& basis_;
  const WrapMotion& motion_;
  const WrapForces& forces_;
  RadialEvaluator<double> field_;
};

std::array<Block, kinds> Assembly::functions(Index b, const RadialBlock<double>& block) const {
  const Index count = block.active_count, all = count + 4,
              valid = std::min(block_size, motion_.places.rows() - b * block_size);
  std::vector<double> rows(static_cast<std::size_t>(count * 4 * block_size));
  ARAPFIELDS_DISPATCH(radial_rows(block, 4, rows.data()));
  std::array<Block, kinds> result;
  result.fill(Block::Zero(all, block_size));
  for (Index a = 0; a < count; ++a)
    for (int c = 0; c < 4; ++c)
      for (Index p = 0; p < valid; ++p)
        result[static_cast<std::size_t>(c)](a, p) =
            static_cast<float>(rows[static_cast<std::size_t>((a * 4 + c) * block_size + p)]);
  for (Index p = 0; p < valid; ++p) {
    result[0](count, p) = 1.0F;
    for (int k = 0; k < 3; ++k) {
      result[0](count + 1 + k, p) = static_cast<float>(motion_.places(b * block_size + p, k));
      result[static_cast<std::size_t>(1 + k)](count + 1 + k, p) = 1.0F;
    }
    const auto* jacobian = &motion_.jacobians(b * block_size + p, 0);
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l)
        result[static_cast<std::size_t>(4 + k)].col(p) +=
            static_cast<float>(jacobian[3 * l + k]) * result[static_cast<std::size_t>(1 + l)].col(p);
  }
  return result;
}

void Assembly::add(Index b, Sums& sums) const {
  const RadialBlock<double> block = field_.block(b);
  const Index count = block.active_count, all = count + 4, centers = basis_.center_count(),
              first = b * block_size, valid = std::min(block_size, motion_.places.rows() - first);
  const std::array<Block, kinds> of = functions(b, block);
  const auto index = [&](Index a) { return a < count ? Index{block.active[a]} : centers + a - count; };
  Eigen::Matrix<float, block_size, 7> factors = Eigen::Matrix<float, block_size, 7>::Zero();
  Eigen::Matrix<float, block_size, 9> left = Eigen::Matrix<float, block_size, 9>::Zero();
  Eigen::Matrix<float, block_size, 3> pulls = Eigen::Matrix<float, block_size, 3>::Zero();
  Eigen::Array<float, block_size, 1> rigid = rigid.Zero(), viscous = viscous.Zero();
  for (Index p = 0; p < valid; ++p) {
    factors.row(p).head<6>() = forces_.forms.row(first + p).cast<float>();
    pulls.row(p) = forces_.pulls.row(first + p).cast<float>();
    rigid[p] = static_cast<float>(motion_.rigid[first + p]);
    viscous[p] = static_cast<float>(motion_.viscous[first + p]);
    const Mat3 jacobian =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&motion_.jacobians(first + p, 0));
    const Mat3 missing = closest_rotation(jacobian) - jacobian;
    for (int k = 0; k < 3; ++k)
      left.row(p).segment<3>(3 * k) = rigid[p] * missing.col(k).transpose().cast<float>();
  }
  Block wide(all, 6 * block_size), asked = of[0] * pulls;
  for (int k = 0; k < 3; ++k) {
    const Block& along = of[static_cast<std::size_t>(4 + k)];
    wide.middleCols(k * block_size, block_size) = along.array().rowwise() * rigid.sqrt().transpose();
    wide.middleCols((3 + k) * block_size, block_size) =
        of[static_cast<std::size_t>(1 + k)].array().rowwise() * viscous.sqrt().transpose();
    asked.noalias() += along * left.middleCols<3>(3 * k);
  }
  const auto scatter = [&](const Block& products, RowMatrix<double>& to) {
    for (Index i = 0; i < all; ++i) {
      double* row = &to(index(i), 0);
      for (Index j = 0; j <= i; ++j) row[index(j)] += static_cast<double>(products(i, j));
    }
  };
  Block products = wide * wide.transpose();
  scatter(products, sums.shared);
  for (int c = 0; c < 6; ++c) {
    products.noalias() =
        (of[0].array().rowwise() * factors.col(c).array().transpose()).matrix() * of[0].transpose();
    scatter(products, sums.coupled[static_cast<std::size_t>(c)]);
  }
  for (Index i = 0; i < all; ++i) sums.asked.row(index(i)) += asked.row(i).cast<double>();
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
  std::vector<Sums> sums = Assembly(basis, motion, forces).sums(progress);
  Sums& sum = sums.front();
  for (std::size_t part = 1; part < sums.size(); ++part) {
    sum.shared += sums[part].shared;
    for (std::size_t c = 0; c < 6; ++c) sum.coupled[c] += sums[part].coupled[c];
    sum.asked += sums[part].asked;
  }
  sum.shared.diagonal().head(basis.center_count()).array() += motion.ridge;
  if (marks.places.rows() > 0) {
    const RowMatrix<double> rows = radial_rows(basis, marks.places, JetOrder::value);
    const double weight = marks.weight / static_cast<double>(rows.rows());
    sum.shared += weight * rows.transpose() * rows;
    sum.asked += weight * rows.transpose() * marks.ways;
  }
  RowMatrix<double> matrix = RowMatrix<double>::Zero(3 * size, 3 * size), asked(3 * size, 1);
  for (int q = 0; q < 3; ++q) {
    add_block(sum.shared, q, q, matrix);
    for (int r = 0; r <= q; ++r)
      add_block(sum.coupled[static_cast<std::size_t>(coupled_of[q][r])], q, r, matrix);
    asked.middleRows(q * size, size) = sum.asked.col(q);
  }
  progress.check();
  const RowMatrix<double> found = cholesky_solve<double>(factor_of(matrix), asked);
  RowMatrix<double> result(size, 3);
  for (int q = 0; q < 3; ++q) result.col(q) = found.middleRows(q * size, size);
  return result;
}

}  // namespace arapfields
