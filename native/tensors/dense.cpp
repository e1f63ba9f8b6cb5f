// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/dense.h"

#include <algorithm>

#include "core/errors.h"
#include "core/parallel.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// A dimension in tiles of about equal length. Products of tiles run side by side, on one thread each; the
/// tiles, and so the results, do not depend on the number of threads.
class Tiles {
 public:
  explicit Tiles(Index length) : length_(length), count_(std::max<Index>(1, (length + most - 1) / most)) {}
  Index count() const { return count_; }
  Index begin(Index i) const { return i * length_ / count_; }
  Tensor of(const Tensor& whole, int dimension, Index i) const {
    return whole.narrow(dimension, begin(i), begin(i + 1) - begin(i));
  }

 private:
  static constexpr Index most = 192;
  Index length_, count_;
};

}  // namespace

template <class Scalar>
void gemm(Transpose transpose_a, Transpose transpose_b, Scalar alpha,
          const Eigen::Ref<const RowMatrix<Scalar>>& a, const Eigen::Ref<const RowMatrix<Scalar>>& b,
          Scalar beta, Eigen::Ref<RowMatrix<Scalar>> c) {
  const ThreadScope scope;
  Tensor ta = tensor_view(a), tb = tensor_view(b);
  if (transpose_a == Transpose::yes) ta = ta.t();
  if (transpose_b == Transpose::yes) tb = tb.t();
  const Tensor tc = tensor_view(c);
  const Tiles rows(c.rows()), columns(c.cols());
  parallel_jobs(rows.count() * columns.count(), [&](Index job) {
    const Index i = job / columns.count(), j = job % columns.count();
    multiply(columns.of(rows.of(tc, 0, i), 1, j), rows.of(ta, 0, i), columns.of(tb, 1, j), alpha, beta);
  });
}

template <class Scalar>
void lower_gram(Transpose transpose_a, const Eigen::Ref<const RowMatrix<Scalar>>& a, Scalar beta,
                Eigen::Ref<RowMatrix<Scalar>> c) {
  const ThreadScope scope;
  Tensor ta = tensor_view(a);
  if (transpose_a == Transpose::yes) ta = ta.t();
  const Tensor tc = tensor_view(c);
  const Tiles tiles(c.rows());
  parallel_jobs(tiles.count() * tiles.count(), [&](Index job) {
    const Index i = job / tiles.count(), j = job % tiles.count();
    if (j > i) return;
    multiply(tiles.of(tiles.of(tc, 0, i), 1, j), tiles.of(ta, 0, i), tiles.of(ta, 0, j).t(), 1.0, beta);
  });
}

/// By blocks of columns, left to right: a block's own factor, what is below it, then its products off the
/// rest.
template <class Scalar>
RowMatrix<Scalar> cholesky(const Eigen::Ref<const RowMatrix<Scalar>>& a) {
  const ThreadScope scope;
  RowMatrix<Scalar> result = RowMatrix<Scalar>::Zero(a.rows(), a.cols());
  for (Index i = 0; i < a.rows(); ++i)  // Eigen's triangularView goes down columns, far slower
    result.row(i).head(i + 1) = a.row(i).head(i + 1);
  const Tensor l = tensor_view(result);
  const Tiles tiles(result.rows());
  const auto tile = [&](Index i, Index j) { return tiles.of(tiles.of(l, 0, i), 1, j); };
  for (Index k = 0; k < tiles.count(); ++k) {
    const Tensor factor = cholesky_factor(tile(k, k));
    if (!factor.defined())
      throw InvalidInput("matrix", "it is not positive definite",
                         "a symmetric positive definite matrix is needed");
    tile(k, k).assign(factor);
    const Index below = tiles.count() - k - 1;
    parallel_jobs(below, [&, upper = factor.t()](Index job) {
      const Tensor panel = tile(k + 1 + job, k);
      panel.assign(solve_triangular(upper, panel, /*upper=*/true, Side::right));
    });
    parallel_jobs(below * below, [&](Index job) {
      const Index i = job / below, j = job % below;
      if (j > i) return;
      multiply(tile(k + 1 + i, k + 1 + j), tile(k + 1 + i, k), tile(k + 1 + j, k).t(), -1.0, 1.0);
    });
  }
  return result;
}

/// Tiles on the diagonal first; then each column of tiles by forward substitution.
template <class Scalar>
RowMatrix<Scalar> lower_inverse(const Eigen::Ref<const RowMatrix<Scalar>>& factor) {
  const ThreadScope scope;
  const Tensor l = tensor_view(factor);
  RowMatrix<Scalar> result = RowMatrix<Scalar>::Zero(factor.rows(), factor.cols());
  const Tensor x = tensor_view(result);
  const Tiles tiles(result.rows());
  const auto tile = [&](const Tensor& of, Index i, Index j) { return tiles.of(tiles.of(of, 0, i), 1, j); };
  parallel_jobs(tiles.count(), [&](Index k) {
    const Tensor own = tile(l, k, k);
    const RowMatrix<Scalar> identity = RowMatrix<Scalar>::Identity(own.size(0), own.size(0));
    tile(x, k, k).assign(solve_triangular(own, tensor_view(identity), /*upper=*/false, Side::left));
  });
  parallel_jobs(tiles.count(), [&](Index j) {
    for (Index i = j + 1; i < tiles.count(); ++i) {
      const Index first = tiles.begin(j), length = tiles.begin(i) - first;
      const Tensor left = tiles.of(l, 0, i).narrow(1, first, length);
      multiply(tile(x, i, j), tile(x, i, i), -product(left, tiles.of(x, 1, j).narrow(0, first, length)));
    }
  });
  return result;
}

template <class Scalar>
RowMatrix<Scalar> cholesky_solve(const Eigen::Ref<const RowMatrix<Scalar>>& factor,
                                 const Eigen::Ref<const RowMatrix<Scalar>>& b) {
  const ThreadScope scope;
  RowMatrix<Scalar> result(b.rows(), b.cols());
  tensor_view(result).assign(solve_by_factor(tensor_view(factor), tensor_view(b)));
  return result;
}

#define ARAPFIELDS_DENSE(Scalar)                                                                       \
  template void gemm<Scalar>(Transpose, Transpose, Scalar, const Eigen::Ref<const RowMatrix<Scalar>>&, \
                             const Eigen::Ref<const RowMatrix<Scalar>>&, Scalar,                       \
                             Eigen::Ref<RowMatrix<Scalar>>);                                           \
  template void lower_gram<Scalar>(Transpose, const Eigen::Ref<const RowMatrix<Scalar>>&, Scalar,      \
                                   Eigen::Ref<RowMatrix<Scalar>>);                                     \
  template RowMatrix<Scalar> cholesky<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&);             \
  template RowMatrix<Scalar> lower_inverse<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&);        \
  template RowMatrix<Scalar> cholesky_solve<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&,        \
                                                    const Eigen::Ref<const RowMatrix<Scalar>>&);
ARAPFIELDS_DENSE(float)
ARAPFIELDS_DENSE(double)

}  // namespace arapfields
