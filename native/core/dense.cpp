// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/dense.h"

#include <ATen/ATen.h>

#include "core/errors.h"

namespace arapfields {
namespace {

template <class Scalar>
at::Tensor view(const Scalar* data, Index rows, Index cols, Index stride) {
  return at::from_blob(const_cast<Scalar*>(data), {rows, cols}, {stride, 1},
                       c10::CppTypeToScalarType<Scalar>::value);
}

template <class Scalar>
at::Tensor view(const Eigen::Ref<const RowMatrix<Scalar>>& m) {
  return view(m.data(), m.rows(), m.cols(), m.outerStride());
}

}  // namespace

template <class Scalar>
void gemm(Transpose transpose_a, Transpose transpose_b, Scalar alpha,
          const Eigen::Ref<const RowMatrix<Scalar>>& a, const Eigen::Ref<const RowMatrix<Scalar>>& b,
          Scalar beta, Eigen::Ref<RowMatrix<Scalar>> c) {
  at::Tensor ta = view<Scalar>(a), tb = view<Scalar>(b);
  if (transpose_a == Transpose::yes) ta = ta.t();
  if (transpose_b == Transpose::yes) tb = tb.t();
  at::Tensor tc = view(c.data(), c.rows(), c.cols(), c.outerStride());
  at::addmm_out(tc, tc, ta, tb, beta, alpha);
}

template <class Scalar>
RowMatrix<Scalar> cholesky(const Eigen::Ref<const RowMatrix<Scalar>>& a) {
  const auto [factor, info] = at::linalg_cholesky_ex(view<Scalar>(a));
  if (info.template item<int>() != 0)
    throw InvalidInput("matrix", "it is not positive definite",
                       "a symmetric positive definite matrix is needed");
  RowMatrix<Scalar> result(a.rows(), a.cols());
  view(result.data(), result.rows(), result.cols(), result.cols()).copy_(factor);
  return result;
}

template <class Scalar>
RowMatrix<Scalar> lower_inverse(const Eigen::Ref<const RowMatrix<Scalar>>& factor) {
  const at::Tensor l = view<Scalar>(factor);
  RowMatrix<Scalar> result(factor.rows(), factor.cols());
  view(result.data(), result.rows(), result.cols(), result.cols())
      .copy_(at::linalg_solve_triangular(l, at::eye(l.size(0), l.options()), /*upper=*/false));
  return result;
}

template <class Scalar>
RowMatrix<Scalar> cholesky_solve(const Eigen::Ref<const RowMatrix<Scalar>>& factor,
                                 const Eigen::Ref<const RowMatrix<Scalar>>& b) {
  RowMatrix<Scalar> result(b.rows(), b.cols());
  view(result.data(), result.rows(), result.cols(), result.cols())
      .copy_(at::cholesky_solve(view<Scalar>(b), view<Scalar>(factor)));
  return result;
}

#define ARAPFIELDS_DENSE(Scalar)                                                                       \
  template void gemm<Scalar>(Transpose, Transpose, Scalar, const Eigen::Ref<const RowMatrix<Scalar>>&, \
                             const Eigen::Ref<const RowMatrix<Scalar>>&, Scalar,                       \
                             Eigen::Ref<RowMatrix<Scalar>>);                                           \
  template RowMatrix<Scalar> cholesky<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&);             \
  template RowMatrix<Scalar> lower_inverse<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&);        \
  template RowMatrix<Scalar> cholesky_solve<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&,        \
                                                    const Eigen::Ref<const RowMatrix<Scalar>>&);
ARAPFIELDS_DENSE(float)
ARAPFIELDS_DENSE(double)

}  // namespace arapfields
