// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// Dense products and Cholesky factors of row-major matrices, in tiles on the threads of the call, by the
/// tensors' backend.
enum class Transpose { no, yes };

/// C = alpha op(A) op(B) + beta C.
template <class Scalar>
void gemm(Transpose transpose_a, Transpose transpose_b, Scalar alpha,
          const Eigen::Ref<const RowMatrix<Scalar>>& a, const Eigen::Ref<const RowMatrix<Scalar>>& b,
          Scalar beta, Eigen::Ref<RowMatrix<Scalar>> c);

/// The lower triangle of C = op(A) op(A)ᵀ + beta C; what is above it is left undefined.
template <class Scalar>
void lower_gram(Transpose transpose_a, const Eigen::Ref<const RowMatrix<Scalar>>& a, Scalar beta,
                Eigen::Ref<RowMatrix<Scalar>> c);

/// Lower Cholesky factor of a symmetric positive definite matrix; throws InvalidInput where it is not.
template <class Scalar>
RowMatrix<Scalar> cholesky(const Eigen::Ref<const RowMatrix<Scalar>>& a);

/// L⁻¹ of a lower triangular L, which must have no zero on its diagonal.
template <class Scalar>
RowMatrix<Scalar> lower_inverse(const Eigen::Ref<const RowMatrix<Scalar>>& factor);

/// Solves L Lᵀ X = B for X (n,k).
template <class Scalar>
RowMatrix<Scalar> cholesky_solve(const Eigen::Ref<const RowMatrix<Scalar>>& factor,
                                 const Eigen::Ref<const RowMatrix<Scalar>>& b);

}  // namespace arapfields
